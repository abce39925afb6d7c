// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/state.hpp"

#include "../datagram/numbers.hpp"
#include "../datagram/word_index.hpp"
#include "device_fields.hpp"
#include "state_fields.hpp"

namespace r4 {
namespace {

// How a field's values look, and which type of State's they are.
enum class Form : std::uint8_t {
  volts,   // int32 in hundredths: "24.28"
  flag,    // bool: 0 or 1
  drive,   // Drive: pwm,direction
  bldc,    // Bldc: speed,direction,brake
  servo,   // uint16, 0-2500
  u8,      // uint8
  u16,     // uint16
  i32,     // int32
  u32,     // uint32
  reason,  // SafeReason
  fault,   // ChipFault: chip,trouble
  // of devices on the user's bus: device_fields.hpp
  reading,  // I2cReading
  answer,   // I2cAnswer
  bus,      // I2cBusReport
  uart,     // UartBytes
};

struct Entry {
  StateField field;
  Form form;
  FieldName name;
  std::size_t offset;  // in State
};

// clang-format off
#define R4_ENTRY(field, form, name, member) \
  {StateField::field, Form::form, FieldName(name), offsetof(State, member)}
constexpr Entry table[] = {
    R4_ENTRY(ain24, volts, "AIN24", raw.analog_cv[0]),
    R4_ENTRY(ain12, volts, "AIN12", raw.analog_cv[1]),
    R4_ENTRY(ain5, volts, "AIN5", raw.analog_cv[2]),
    R4_ENTRY(aindmh, volts, "AINDMH", raw.analog_cv[3]),
    R4_ENTRY(dmhsta, flag, "DMHSTA", handle_held),
    R4_ENTRY(ainsteer, volts, "AINSTEER", raw.analog_cv[4]),
    R4_ENTRY(dhb1a, drive, "DHB1A", raw.dhb12[0]),
    R4_ENTRY(osmc1, drive, "OSMC1", raw.osmc[0]),
    R4_ENTRY(step1pos, i32, "STEP1POS", raw.stepper_steps[0]),
    R4_ENTRY(servo1pos, servo, "SERVO1POS", raw.servo_us[0]),
    R4_ENTRY(ain6, volts, "AIN6", raw.analog_cv[5]),
    R4_ENTRY(dhb1b, drive, "DHB1B", raw.dhb12[1]),
    R4_ENTRY(dhb2a, drive, "DHB2A", raw.dhb12[2]),
    R4_ENTRY(dhb2b, drive, "DHB2B", raw.dhb12[3]),
    R4_ENTRY(osmc2, drive, "OSMC2", raw.osmc[1]),
    R4_ENTRY(osmc3, drive, "OSMC3", raw.osmc[2]),
    R4_ENTRY(osmc4, drive, "OSMC4", raw.osmc[3]),
    R4_ENTRY(step2pos, i32, "STEP2POS", raw.stepper_steps[1]),
    R4_ENTRY(step3pos, i32, "STEP3POS", raw.stepper_steps[2]),
    R4_ENTRY(step4pos, i32, "STEP4POS", raw.stepper_steps[3]),
    R4_ENTRY(servo2pos, servo, "SERVO2POS", raw.servo_us[1]),
    R4_ENTRY(servo3pos, servo, "SERVO3POS", raw.servo_us[2]),
    R4_ENTRY(servo4pos, servo, "SERVO4POS", raw.servo_us[3]),
    R4_ENTRY(servo5pos, servo, "SERVO5POS", raw.servo_us[4]),
    R4_ENTRY(servo6pos, servo, "SERVO6POS", raw.servo_us[5]),
    R4_ENTRY(servo7pos, servo, "SERVO7POS", raw.servo_us[6]),
    R4_ENTRY(servo8pos, servo, "SERVO8POS", raw.servo_us[7]),
    R4_ENTRY(servo9pos, servo, "SERVO9POS", raw.servo_us[8]),
    R4_ENTRY(servo10pos, servo, "SERVO10POS", raw.servo_us[9]),
    R4_ENTRY(servo11pos, servo, "SERVO11POS", raw.servo_us[10]),
    R4_ENTRY(servo12pos, servo, "SERVO12POS", raw.servo_us[11]),
    R4_ENTRY(servo13pos, servo, "SERVO13POS", raw.servo_us[12]),
    R4_ENTRY(servo14pos, servo, "SERVO14POS", raw.servo_us[13]),
    R4_ENTRY(servo15pos, servo, "SERVO15POS", raw.servo_us[14]),
    R4_ENTRY(servo16pos, servo, "SERVO16POS", raw.servo_us[15]),
    R4_ENTRY(enc1, i32, "ENC1", raw.encoder_counts[0]),
    R4_ENTRY(enc2, i32, "ENC2", raw.encoder_counts[1]),
    R4_ENTRY(enc3, i32, "ENC3", raw.encoder_counts[2]),
    R4_ENTRY(enc4, i32, "ENC4", raw.encoder_counts[3]),
    R4_ENTRY(us1, u16, "US1", raw.ultrasonic_cm[0]),
    R4_ENTRY(us2, u16, "US2", raw.ultrasonic_cm[1]),
    R4_ENTRY(us3, u16, "US3", raw.ultrasonic_cm[2]),
    R4_ENTRY(us4, u16, "US4", raw.ultrasonic_cm[3]),
    R4_ENTRY(bldc1, bldc, "BLDC1", raw.bldc[0]),
    R4_ENTRY(bldc2, bldc, "BLDC2", raw.bldc[1]),
    R4_ENTRY(bldc3, bldc, "BLDC3", raw.bldc[2]),
    R4_ENTRY(bldc4, bldc, "BLDC4", raw.bldc[3]),
    R4_ENTRY(relays, u8, "RELAYS", relays),
    R4_ENTRY(safe, reason, "SAFE", safe),
    R4_ENTRY(cmd, u32, "CMD", last_command),
    R4_ENTRY(rxok, u32, "RXOK", rx_ok),
    R4_ENTRY(rxcrc, u32, "RXCRC", rx_crc),
    R4_ENTRY(rxlost, u32, "RXLOST", rx_lost),
    R4_ENTRY(rxdup, u32, "RXDUP", rx_duplicate),
    R4_ENTRY(rxref, u32, "RXREF", rx_refused),
    R4_ENTRY(late, u32, "LATE", late),
    R4_ENTRY(enc1hz, i32, "ENC1HZ", raw.encoder_hz[0]),
    R4_ENTRY(enc2hz, i32, "ENC2HZ", raw.encoder_hz[1]),
    R4_ENTRY(enc3hz, i32, "ENC3HZ", raw.encoder_hz[2]),
    R4_ENTRY(enc4hz, i32, "ENC4HZ", raw.encoder_hz[3]),
    R4_ENTRY(enc1idx, i32, "ENC1IDX", raw.encoder_index_counts[0]),
    R4_ENTRY(enc2idx, i32, "ENC2IDX", raw.encoder_index_counts[1]),
    R4_ENTRY(enc3idx, i32, "ENC3IDX", raw.encoder_index_counts[2]),
    R4_ENTRY(enc4idx, i32, "ENC4IDX", raw.encoder_index_counts[3]),
    R4_ENTRY(i2c1, reading, "I2C1", raw.i2c[0]),
    R4_ENTRY(i2c2, reading, "I2C2", raw.i2c[1]),
    R4_ENTRY(i2c3, reading, "I2C3", raw.i2c[2]),
    R4_ENTRY(i2c4, reading, "I2C4", raw.i2c[3]),
    R4_ENTRY(i2c5, reading, "I2C5", raw.i2c[4]),
    R4_ENTRY(i2c6, reading, "I2C6", raw.i2c[5]),
    R4_ENTRY(i2c7, reading, "I2C7", raw.i2c[6]),
    R4_ENTRY(i2c8, reading, "I2C8", raw.i2c[7]),
    R4_ENTRY(i2cx, answer, "I2CX", i2c_answer),
    R4_ENTRY(i2cbus, bus, "I2CBUS", i2c_bus),
    R4_ENTRY(uart1, uart, "UART1", raw.uart[0]),
    R4_ENTRY(uart2, uart, "UART2", raw.uart[1]),
    R4_ENTRY(dac1, u16, "DAC1", raw.dac_mv[0]),
    R4_ENTRY(dac2, u16, "DAC2", raw.dac_mv[1]),
    R4_ENTRY(gpio, u8, "GPIO", gpio),
    R4_ENTRY(fault, fault, "FAULT", fault),
};
#undef R4_ENTRY
// clang-format on

constexpr bool in_order() {
  for (int i = 0; i < state_field_count; ++i) {
    if (table[i].field != static_cast<StateField>(i) || !table[i].name.allowed()) return false;
  }
  return true;
}
static_assert(sizeof table / sizeof table[0] == state_field_count, "one entry for every field");
static_assert(in_order(), "the table is indexed by StateField, its names are of the grammar");

constexpr const Entry& entry_of(StateField field) { return table[static_cast<int>(field)]; }

template <class Member>
const Member& member(const State& state, const Entry& entry) {
  return *reinterpret_cast<const Member*>(reinterpret_cast<const char*>(&state) + entry.offset);
}
template <class Member>
Member& member(State& state, const Entry& entry) {
  return *reinterpret_cast<Member*>(reinterpret_cast<char*>(&state) + entry.offset);
}

constexpr Text name_of_entry(const Entry& entry) { return entry.name.name(); }
constexpr WordIndex<Entry, state_field_count, name_of_entry> name_index(table);

bool parse_up_to(Text text, std::uint32_t limit, std::uint32_t& out) {
  return parse_number(text, out) && out <= limit;
}

// Parses `text` into a member whose type holds 0 to `limit`.
template <class Member>
bool parse_into(Text text, std::uint32_t limit, Member& out) {
  std::uint32_t value = 0;
  if (!parse_up_to(text, limit, value)) return false;
  out = static_cast<Member>(value);
  return true;
}

// Takes the first value off `rest`.
Text next_value(Text& rest) {
  std::size_t size = 0;
  while (size < rest.size() && rest[size] != ',') ++size;
  const Text value = rest.substr(0, size);
  rest = rest.substr(size < rest.size() ? size + 1 : size);
  return value;
}

// The last value is the whole rest: one too many leaves a comma in it, one too few leaves nothing.
bool parse_drive(Text rest, Drive& out) {
  return parse_into(next_value(rest), pwm_max, out.pwm) && parse_into(rest, 1, out.direction);
}

bool parse_bldc(Text rest, Bldc& out) {
  return parse_into(next_value(rest), pwm_max, out.speed) &&
         parse_into(next_value(rest), 1, out.direction) && parse_into(rest, 1, out.brake);
}

bool parse_fault(Text rest, ChipFault& out) {
  return parse_into(next_value(rest), 0x7F, out.address) && parse_into(rest, 0xFF, out.trouble);
}

// `text` is the field's values; the number parsers refuse a comma.
bool parse_entry(Text text, const Entry& entry, State& state) {
  switch (entry.form) {
    case Form::volts:
      return parse_hundredths(text, member<std::int32_t>(state, entry));
    case Form::flag:
      return parse_into(text, 1, member<bool>(state, entry));
    case Form::drive:
      return parse_drive(text, member<Drive>(state, entry));
    case Form::bldc:
      return parse_bldc(text, member<Bldc>(state, entry));
    case Form::servo:
      return parse_into(text, servo_max_us, member<std::uint16_t>(state, entry));
    case Form::u8:
      return parse_into(text, 0xFF, member<std::uint8_t>(state, entry));
    case Form::u16:
      return parse_into(text, 0xFFFF, member<std::uint16_t>(state, entry));
    case Form::i32:
      return parse_number(text, member<std::int32_t>(state, entry));
    case Form::u32:
      return parse_number(text, member<std::uint32_t>(state, entry));
    case Form::reason:
      return parse_safe_reason(text, member<SafeReason>(state, entry));
    case Form::fault:
      return parse_fault(text, member<ChipFault>(state, entry));
    case Form::reading:
      return parse_device(text, member<I2cReading>(state, entry));
    case Form::answer:
      return parse_device(text, member<I2cAnswer>(state, entry));
    case Form::bus:
      return parse_device(text, member<I2cBusReport>(state, entry));
    case Form::uart:
      return parse_device(text, member<UartBytes>(state, entry));
  }
  return false;
}

}  // namespace

FieldSet FieldSet::paper_default() {
  static_assert(static_cast<int>(StateField::servo1pos) + 1 < word_bits, "all in the first word");
  FieldSet set;
  set.words_[0] = (bit_of(StateField::servo1pos) << 1) - 1;
  return set;
}

FieldSet FieldSet::all() {
  FieldSet set;
  for (int i = 0; i < static_cast<int>(StateField::i2c1); ++i) set.add(static_cast<StateField>(i));
  return set;
}

Text name_of(StateField field) { return entry_of(field).name.name(); }

StateField state_field(Text name) {
  const unsigned index = name_index.find(name);
  return index == no_index ? StateField::count : static_cast<StateField>(index);
}

void write_field(DatagramWriter& writer, StateField field, const State& state) {
  const Entry& entry = entry_of(field);
  writer.field(entry.name);
  switch (entry.form) {
    case Form::volts:
      writer.hundredths(member<std::int32_t>(state, entry));
      break;
    case Form::flag:
      writer.value(static_cast<std::uint32_t>(member<bool>(state, entry)));
      break;
    case Form::drive: {
      const Drive& drive = member<Drive>(state, entry);
      writer.value(std::uint32_t{drive.pwm}).value(static_cast<std::uint32_t>(drive.direction));
      break;
    }
    case Form::bldc: {
      const Bldc& bldc = member<Bldc>(state, entry);
      writer.value(std::uint32_t{bldc.speed})
          .value(static_cast<std::uint32_t>(bldc.direction))
          .value(static_cast<std::uint32_t>(bldc.brake));
      break;
    }
    case Form::servo:
    case Form::u16:
      writer.value(std::uint32_t{member<std::uint16_t>(state, entry)});
      break;
    case Form::u8:
      writer.value(std::uint32_t{member<std::uint8_t>(state, entry)});
      break;
    case Form::i32:
      writer.value(member<std::int32_t>(state, entry));
      break;
    case Form::u32:
      writer.value(member<std::uint32_t>(state, entry));
      break;
    case Form::reason:
      writer.value(static_cast<std::uint32_t>(member<SafeReason>(state, entry)));
      break;
    case Form::fault: {
      const ChipFault& fault = member<ChipFault>(state, entry);
      writer.value(std::uint32_t{fault.address}).value(static_cast<std::uint32_t>(fault.trouble));
      break;
    }
    case Form::reading:
      write_device(writer, member<I2cReading>(state, entry));
      break;
    case Form::answer:
      write_device(writer, member<I2cAnswer>(state, entry));
      break;
    case Form::bus:
      write_device(writer, member<I2cBusReport>(state, entry));
      break;
    case Form::uart:
      write_device(writer, member<UartBytes>(state, entry));
      break;
  }
}

namespace {

bool read_fields(const Datagram& datagram, State& state) {
  FieldSet present;
  int expected = 0;  // boards send in the table's order, so the next entry is the likely one
  for (const Field& field : datagram) {
    int index = expected;
    if (index == state_field_count || table[index].name.name() != field.name()) {
      index = static_cast<int>(state_field(field.name()));
      if (index == state_field_count) continue;
    }
    const auto which = static_cast<StateField>(index);
    if (present.has(which) || !parse_entry(field.values(), table[index], state)) return false;
    present.add(which);
    expected = index + 1;
  }
  state.present = present;
  return true;
}

}  // namespace

bool parse_safe_reason(Text text, SafeReason& out) {
  std::uint32_t number = 0;
  if (!parse_number(text, number)) return false;
  out = to_safe_reason(number);
  return true;
}

bool read_state(const Datagram& datagram, State& state) {
  if (datagram.has_time() && datagram.time_ms() > 0xFFFFFFFFU) return false;
  // Written in place and taken back on failure: copying what was just written costs more.
  const State before = state;
  if (!read_fields(datagram, state)) {
    state = before;
    return false;
  }
  if (datagram.has_pnum()) state.pnum = datagram.pnum();
  if (datagram.has_time()) state.t_ms = static_cast<std::uint32_t>(datagram.time_ms());
  return true;
}

}  // namespace r4
