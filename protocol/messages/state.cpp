// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/state.hpp"

#include <cstddef>
#include <cstring>
#include <type_traits>

#include "../datagram/field_reader.hpp"
#include "../datagram/numbers.hpp"
#include "../datagram/word_index.hpp"
#include "device_fields.hpp"
#include "r4link/tables/state_fields.hpp"
#include "state_fields.hpp"

namespace r4 {
namespace {

using Form = FieldForm;

struct Entry {
  FieldName name;
  FieldForm form = FieldForm::volts;
  std::uint16_t place = 0;  // offset in State
};
static_assert(sizeof(Entry) == 16, "a power of two, so that finding an entry is a shift");

struct FieldTable {
  Entry entries[state_field_count];

  constexpr FieldTable() : entries() {
    for (int i = 0; i < state_field_count; ++i) {
      const StateFieldRow& row = state_fields[i];
      const FieldKindRow& kind = row_of(row.kind);
      Entry& entry = entries[i];
      entry.name = FieldName(row.name);
      entry.form = kind.form;
      entry.place = static_cast<std::uint16_t>(kind.place + (row.channel - 1) * kind.size);
    }
  }
};
constexpr FieldTable field_table;

constexpr bool has_allowed_names() {
  for (const Entry& entry : field_table.entries) {
    if (!entry.name.allowed()) return false;
  }
  return true;
}
static_assert(has_allowed_names(), "the names are of the grammar");
static_assert(sizeof(State) <= 0xFFFF, "places have 16 bits");

constexpr const Entry& entry_of(StateField field) {
  return field_table.entries[static_cast<int>(field)];
}

template <class Member>
const Member& member(const State& state, const Entry& entry) {
  return *reinterpret_cast<const Member*>(reinterpret_cast<const char*>(&state) + entry.place);
}
template <class Member>
Member& member(State& state, const Entry& entry) {
  return *reinterpret_cast<Member*>(reinterpret_cast<char*>(&state) + entry.place);
}

constexpr Text name_of_entry(const Entry& entry) { return entry.name.name(); }
constexpr WordIndex<Entry, state_field_count, name_of_entry> name_index(field_table.entries);

bool read_drive(FieldReader& reader, Drive& out) {
  return reader.take(pwm_max, out.pwm) && reader.take(',') && reader.take(1, out.direction);
}

bool read_bldc(FieldReader& reader, Bldc& out) {
  return reader.take(pwm_max, out.speed) && reader.take(',') && reader.take(1, out.direction) &&
         reader.take(',') && reader.take(1, out.brake);
}

bool read_fault(FieldReader& reader, ChipFault& out) {
  return reader.take(0x7F, out.address) && reader.take(',') && reader.take(0xFF, out.trouble);
}

// Reads values in the form of `entry`. The caller refuses a surplus value.
bool read_entry(FieldReader& reader, const Entry& entry, State& state) {
  switch (entry.form) {
    case Form::volts:
      return reader.take_hundredths(member<std::int32_t>(state, entry));
    case Form::handle:
      return reader.take(2, member<Handle>(state, entry));
    case Form::drive:
      return read_drive(reader, member<Drive>(state, entry));
    case Form::bldc:
      return read_bldc(reader, member<Bldc>(state, entry));
    case Form::servo:
      return reader.take(servo_max_us, member<std::uint16_t>(state, entry));
    case Form::u8:
      return reader.take(0xFF, member<std::uint8_t>(state, entry));
    case Form::u16:
      return reader.take(0xFFFF, member<std::uint16_t>(state, entry));
    case Form::i32:
      return reader.take(member<std::int32_t>(state, entry));
    case Form::u32:
      return reader.take(0xFFFFFFFFU, member<std::uint32_t>(state, entry));
    case Form::reason:
      return parse_safe_reason(reader.take_values(), member<SafeReason>(state, entry));
    case Form::fault:
      return read_fault(reader, member<ChipFault>(state, entry));
    case Form::reading:
      return parse_device(reader.take_values(), member<I2cReading>(state, entry));
    case Form::answer:
      return parse_device(reader.take_values(), member<I2cAnswer>(state, entry));
    case Form::bus:
      return parse_device(reader.take_values(), member<I2cBusReport>(state, entry));
    case Form::uart:
      return parse_device(reader.take_values(), member<UartBytes>(state, entry));
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

StateField state_field(FieldKind kind, int channel) {
  for (int i = 0; i < state_field_count; ++i) {
    const StateFieldRow& row = state_fields[i];
    if (row.kind == kind && row.channel == channel) return static_cast<StateField>(i);
  }
  return StateField::count;
}

void write_field(DatagramWriter& writer, StateField field, const State& state) {
  const Entry& entry = entry_of(field);
  writer.field(entry.name);
  switch (entry.form) {
    case Form::volts:
      writer.hundredths(member<std::int32_t>(state, entry));
      break;
    case Form::handle:
      writer.value(static_cast<std::uint32_t>(member<Handle>(state, entry)));
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

// A state before a datagram is read into it. Few datagrams contain the members from `rare_place`
// on, which are most of the state. So these members are copied only before their first change.
class Before {
 public:
  explicit Before(State& state) : state_(state) { std::memcpy(common_, bytes(), rare_place); }
  void will_change(const Entry& entry) {
    if (entry.place < rare_place || rare_copied_) return;
    std::memcpy(rare_, bytes() + rare_place, sizeof rare_);
    rare_copied_ = true;
  }
  void restore() {
    std::memcpy(bytes(), common_, rare_place);
    if (rare_copied_) std::memcpy(bytes() + rare_place, rare_, sizeof rare_);
  }

 private:
  static constexpr std::size_t rare_place = offsetof(State, raw.i2c);
  static_assert(std::is_trivially_copyable<State>::value, "its bytes are copied");

  char* bytes() { return reinterpret_cast<char*>(&state_); }

  State& state_;
  bool rare_copied_ = false;
  char common_[rare_place];
  char rare_[sizeof(State) - rare_place];
};

// The index of the field whose name is next; state_field_count for an unknown field.
int take_index(FieldReader& reader, int expected) {
  if (expected < state_field_count && reader.take_name(field_table.entries[expected].name.name())) {
    return expected;
  }
  return static_cast<int>(state_field(reader.take_name()));
}

bool read_fields(const Datagram& datagram, State& state, Before& before) {
  FieldSet present;
  int expected = 0;  // boards send fields in the table's order
  for (FieldReader reader(datagram); !reader.at_end();) {
    const int index = take_index(reader, expected);
    if (index == state_field_count) {
      reader.take_values();
    } else {
      const auto which = static_cast<StateField>(index);
      const Entry& entry = field_table.entries[index];
      before.will_change(entry);
      if (present.has(which) || !read_entry(reader, entry, state)) return false;
      present.add(which);
      expected = index + 1;
    }
    if (!reader.take(';')) return false;
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
  // The fields are written in place, which is faster than a copy of the state. If a field cannot be
  // read, the old values are restored.
  Before before(state);
  if (!read_fields(datagram, state, before)) {
    before.restore();
    return false;
  }
  if (datagram.has_pnum()) state.pnum = datagram.pnum();
  if (datagram.has_time()) state.t_ms = static_cast<std::uint32_t>(datagram.time_ms());
  return true;
}

}  // namespace r4
