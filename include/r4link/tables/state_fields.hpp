// SPDX-License-Identifier: GPL-3.0-or-later
// The state fields (docs/reference/protocol.md), from board.def. A field has a kind and a channel.
// A kind has the form, the units and the State member of its values.
//     for (const StateFieldRow& row : state_fields) …   in the order of the wire
//     state_field(FieldKind::osmc, 2)                   StateField::osmc2
//     numbers_of(state, StateField::osmc2)[0]           its duty cycle, 0-4095
//     kind_row_of(StateField::osmc2).values[0].unit     "0-4095"
//
// A program that reads these tables only at compile time, such as the firmware, contains no texts.
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>

#include "../config.hpp"
#include "../state.hpp"
#include "../text.hpp"
#include "../vocabulary.hpp"
#include "commands.hpp"

namespace r4 {

enum class FieldKind : std::uint8_t {
#define R4_FIELD_KIND(kind, ...) kind,
#include "board.def"
  count
};
constexpr int field_kind_count = static_cast<int>(FieldKind::count);

// The form of a field's values on the wire, and their type in State.
enum class FieldForm : std::uint8_t {
  volts,   // int32 in hundredths: "24.28"
  handle,  // Handle: 0 to 2
  drive,   // Drive: pwm,direction
  bldc,    // Bldc: speed,direction,brake
  servo,   // uint16, 0-2500
  u8,
  u16,
  i32,
  u32,
  reason,  // SafeReason
  fault,   // ChipFault: chip,trouble
  // devices on the user's bus and UARTs (docs/how-to/devices.md)
  reading,  // I2cReading
  answer,   // I2cAnswer
  bus,      // I2cBusReport
  uart,     // UartBytes
};

struct StateFieldRow {
  Text name;  // on the wire
  StateField field;
  FieldKind kind;
  std::uint8_t channel;  // from 1; 1 for a kind with one field
};

constexpr StateFieldRow state_fields[] = {
#define R4_STATE_FIELD(field, name, kind, channel) \
  {name, StateField::field, FieldKind::kind, channel},
#include "board.def"
};

struct FieldValue {
  const char* name;  // "pwm"; "" if the field has only one value
  const char* unit;  // "V"; without a unit the range: "0-4095"
};
constexpr int most_field_values = 3;

struct FieldKindRow {
  const char* name;  // "osmc"
  FieldKind kind;
  FieldForm form;
  std::uint16_t place;                   // of channel 1 in State; channel n is n-1 sizes later
  std::uint16_t size;                    // of the value of a channel in State
  FieldValue values[most_field_values];  // unused values have no unit
  const char* help;                      // one sentence

  // True if the last value is the bytes of a device, "x3b00".
  constexpr bool has_bytes() const {
    return form == FieldForm::reading || form == FieldForm::answer || form == FieldForm::uart;
  }
  constexpr int value_count() const {
    int count = 0;
    while (count < most_field_values && values[count].unit != nullptr) ++count;
    return count;
  }
};

constexpr FieldKindRow field_kinds[] = {
#define R4_FIELD_KIND(kind, form, member, help, ...)                      \
  {#kind,                                                                 \
   FieldKind::kind,                                                       \
   FieldForm::form,                                                       \
   static_cast<std::uint16_t>(offsetof(State, member)),                   \
   sizeof(std::remove_extent_t<decltype(std::declval<State&>().member)>), \
   {__VA_ARGS__},                                                         \
   help},
#include "board.def"
};

constexpr const StateFieldRow& row_of(StateField field) {
  return state_fields[static_cast<int>(field)];
}
constexpr const FieldKindRow& row_of(FieldKind kind) { return field_kinds[static_cast<int>(kind)]; }
constexpr const FieldKindRow& kind_row_of(StateField field) { return row_of(row_of(field).kind); }

// The kind of field that shows a command's setpoint; FieldKind::count if no field shows it.
constexpr FieldKind shown_by(CommandKind command) {
  switch (command) {
#define R4_OUTPUT(kind, ...) \
  case CommandKind::kind:    \
    return FieldKind::kind;
#include "board.def"
    case CommandKind::stepper:
      return FieldKind::stepper;
    case CommandKind::relay:
      return FieldKind::relays;
    default:
      return FieldKind::count;
  }
}

// `channel`: from 1. If there is no such channel: StateField::count.
R4LINK_API StateField state_field(FieldKind kind, int channel);

// The numbers of a field, in the order and units of its kind. For FieldForm::reading, answer and
// uart, only the first two values: the bytes of a device are not numbers.
struct StateNumbers {
  int count;
  double values[most_field_values];
  double operator[](int i) const { return values[i]; }
};
R4LINK_API StateNumbers numbers_of(const State& state, StateField field);
// The inverse of numbers_of(), rounded to the field's type. `present` is unchanged. False, with
// `state` unchanged, for a number out of range, a wrong count, or a field with bytes.
R4LINK_API bool set_numbers(State& state, StateField field, const StateNumbers& numbers);

}  // namespace r4
