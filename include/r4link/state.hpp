// SPDX-License-Identifier: GPL-3.0-or-later
// The board's state as typed values, and the fields that carry it (paper section 4.1).
// tables/board.def names every field, its unit and its member in State.
#pragma once

#include <cstdint>

#include "config.hpp"
#include "text.hpp"
#include "vocabulary.hpp"

namespace r4 {

class Datagram;

// In wire order: first the paper's ten; from I2C1 on, devices (docs/how-to/devices.md) and faults.
enum class StateField : std::uint8_t {
#define R4_STATE_FIELD(field, ...) field,
#include "tables/board.def"
  count
};
constexpr int state_field_count = static_cast<int>(StateField::count);

// A set of state fields, such as a selection to send or the fields of a datagram.
class R4LINK_API FieldSet {
 public:
  constexpr FieldSet() = default;
  // False for StateField::count.
  constexpr bool has(StateField f) const { return (words_[word_of(f)] & bit_of(f)) != 0; }
  void add(StateField f) { words_[word_of(f)] |= bit_of(f); }
  void remove(StateField f) { words_[word_of(f)] &= ~bit_of(f); }
  void add(const FieldSet& other) {
    for (int i = 0; i < word_count; ++i) words_[i] |= other.words_[i];
  }
  bool empty() const { return *this == FieldSet(); }
  // The fields in wire order: `for (StateField field : set)`.
  class Iterator {
   public:
    Iterator(const std::uint32_t* words, int first)
        : words_(words), word_(first), bits_(first < word_count ? words[first] : 0) {
      pass_empty_words();
    }
    StateField operator*() const {
      return static_cast<StateField>(word_ * word_bits + __builtin_ctz(bits_));
    }
    Iterator& operator++() {
      bits_ &= bits_ - 1;
      pass_empty_words();
      return *this;
    }
    friend bool operator!=(const Iterator& a, const Iterator& b) {
      return a.word_ != b.word_ || a.bits_ != b.bits_;
    }

   private:
    void pass_empty_words() {
      while (bits_ == 0 && word_ < word_count) bits_ = ++word_ < word_count ? words_[word_] : 0;
    }
    const std::uint32_t* words_;
    int word_;
    std::uint32_t bits_;  // the bits of words_[word_] that have not been visited
  };
  Iterator begin() const { return Iterator(words_, 0); }
  Iterator end() const { return Iterator(words_, word_count); }

  friend bool operator==(const FieldSet& a, const FieldSet& b) {
    for (int i = 0; i < word_count; ++i) {
      if (a.words_[i] != b.words_[i]) return false;
    }
    return true;
  }
  friend bool operator!=(const FieldSet& a, const FieldSet& b) { return !(a == b); }

  static FieldSet paper_default();  // AIN24 … SERVO1POS
  // All fields except I2C1 to GPIO (the user's devices) and FAULT (sent while there is a fault).
  static FieldSet all();

 private:
  static constexpr int word_bits = 32;
  static constexpr int word_count = state_field_count / word_bits + 1;
  static constexpr int word_of(StateField f) { return static_cast<int>(f) / word_bits; }
  static constexpr std::uint32_t bit_of(StateField f) {
    return std::uint32_t{1} << static_cast<int>(f) % word_bits;
  }

  std::uint32_t words_[word_count] = {};
};

// The board's analog inputs in the paper's order; values in hundredths of a volt.
enum class Analog : std::uint8_t { ain24, ain12, ain5, aindmh, ainsteer, ain6, count };
constexpr int analog_channels = static_cast<int>(Analog::count);

// Channel n of the board is element n-1.
struct ChannelValues {
  std::int32_t analog_cv[analog_channels] = {};  // hundredths of a volt
#define R4_OUTPUT(kind, Value, member, channels, ...) Value member[channels] = {};
#include "tables/board.def"
  std::int32_t stepper_steps[stepper_channels] = {};
  std::int32_t encoder_counts[encoder_channels] = {};
  std::int32_t encoder_hz[encoder_channels] = {};            // counts per second
  std::int32_t encoder_index_counts[encoder_channels] = {};  // count when the index line rose last
  std::uint16_t ultrasonic_cm[ultrasonic_channels] = {};
  I2cReading i2c[i2c_slots];
  UartBytes uart[uart_channels];
};

// On a host, `present` has the fields of this state's datagram; other fields keep earlier values.
struct State {
  FieldSet present;
  std::uint32_t pnum = 0;
  std::uint32_t t_ms = 0;  // the board's clock; wraps
  Handle handle = Handle::released;
  std::uint8_t relays = 0;  // bit n-1 is relay n
  SafeReason safe = SafeReason::none;
  std::uint8_t gpio = 0;           // bit n-1 is input n
  std::uint32_t last_command = 0;  // CMD
  std::uint32_t rx_ok = 0;
  std::uint32_t rx_crc = 0;
  std::uint32_t rx_lost = 0;
  std::uint32_t rx_duplicate = 0;
  std::uint32_t rx_refused = 0;
  std::uint32_t late = 0;
  ChannelValues raw;
  ChipFault fault;
  I2cAnswer i2c_answer;
  I2cBusReport i2c_bus;

  // True if the dead-man's handle is held, or if the board has none.
  bool handle_held() const { return handle != Handle::released; }
  // Channels are numbered from 1 in the functions below. A channel that does not exist reads 0.
  double volts(Analog input) const {
    const int i = static_cast<int>(input);
    return i < analog_channels ? raw.analog_cv[i] / 100.0 : 0.0;
  }
  // osmc(), dhb12(), servo_us(), bldc(), dac_mv(): the outputs as driven, off in the safe state.
#define R4_OUTPUT(kind, Value, member, channels, ...) \
  Value member(int channel) const { return reading(raw.member, channel); }
#include "tables/board.def"
  std::int32_t steps(int channel) const { return reading(raw.stepper_steps, channel); }
  std::int32_t encoder(int channel) const { return reading(raw.encoder_counts, channel); }
  // Counts per second; negative backwards.
  std::int32_t encoder_hz(int channel) const { return reading(raw.encoder_hz, channel); }
  // The count when the index line rose last.
  std::int32_t encoder_index(int channel) const {
    return reading(raw.encoder_index_counts, channel);
  }
  int distance_cm(int channel) const { return reading(raw.ultrasonic_cm, channel); }
  bool input(int channel) const {
    return channel >= 1 && channel <= gpio_channels && (gpio >> (channel - 1) & 1) != 0;
  }
  bool relay(int channel) const {
    return channel >= 1 && channel <= relay_channels && (relays >> (channel - 1) & 1) != 0;
  }

 private:
  template <class Value, int count>
  static Value reading(const Value (&values)[count], int channel) {
    return channel >= 1 && channel <= count ? values[channel - 1] : Value();
  }
};

// The name on the wire, "AIN24".
R4LINK_API Text name_of(StateField field);
// The field with this name. If there is no such field: StateField::count. Constant time.
R4LINK_API StateField state_field(Text name);

// Reads `F`: "DEFAULT", "ALL" or names, with commas. Refusal::unknown for another word.
R4LINK_API Refusal parse_fields(Text list, FieldSet& out);

// Reads the state fields of `datagram` into `state` and sets `present`, `pnum` and `t_ms`. Ignores
// unknown fields. False, with `state` unchanged, if a known field is invalid or a duplicate.
R4LINK_API bool read_state(const Datagram& datagram, State& state);

}  // namespace r4
