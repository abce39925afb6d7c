// SPDX-License-Identifier: GPL-3.0-or-later
// A field's numbers as doubles. The emulated board omits this file: it uses no floating point.
#include "r4link/tables/state_fields.hpp"
#include "state_fields.hpp"

namespace r4 {
namespace {

using Form = FieldForm;

template <class... Values>
StateNumbers numbers(Values... values) {
  return {sizeof...(values), {static_cast<double>(values)...}};
}

// `Member` must be the type of the field's kind in State.
template <class Member>
const Member& member(const State& state, StateField field) {
  const FieldKindRow& kind = kind_row_of(field);
  const auto place = kind.place + std::size_t{kind.size} * (row_of(field).channel - 1U);
  return *reinterpret_cast<const Member*>(reinterpret_cast<const char*>(&state) + place);
}

}  // namespace

StateNumbers numbers_of(const State& state, StateField field) {
  if (field >= StateField::count) return {};
  switch (kind_row_of(field).form) {
    case Form::volts:
      return numbers(member<std::int32_t>(state, field) / 100.0);
    case Form::handle:
      return numbers(member<Handle>(state, field));
    case Form::drive: {
      const Drive& drive = member<Drive>(state, field);
      return numbers(drive.pwm, drive.direction);
    }
    case Form::bldc: {
      const Bldc& bldc = member<Bldc>(state, field);
      return numbers(bldc.speed, bldc.direction, bldc.brake);
    }
    case Form::servo:
    case Form::u16:
      return numbers(member<std::uint16_t>(state, field));
    case Form::u8:
      return numbers(member<std::uint8_t>(state, field));
    case Form::i32:
      return numbers(member<std::int32_t>(state, field));
    case Form::u32:
      return numbers(member<std::uint32_t>(state, field));
    case Form::reason:
      return numbers(member<SafeReason>(state, field));
    case Form::fault: {
      const ChipFault& fault = member<ChipFault>(state, field);
      return numbers(fault.address, fault.trouble);
    }
    case Form::reading: {
      const I2cReading& reading = member<I2cReading>(state, field);
      return numbers(reading.t_ms, reading.errors);
    }
    case Form::answer:
      return numbers(state.i2c_answer.pnum, state.i2c_answer.outcome);
    case Form::bus:
      return numbers(state.i2c_bus.newest, state.i2c_bus.errors, state.i2c_bus.recoveries);
    case Form::uart: {
      const UartBytes& uart = member<UartBytes>(state, field);
      return numbers(uart.position, uart.lost);
    }
  }
  return {};
}

// Writes a datagram, so that the parser checks the numbers.
bool set_numbers(State& state, StateField field, const StateNumbers& numbers) {
  if (field >= StateField::count || numbers.count > most_field_values) return false;
  char buffer[128];
  DatagramWriter writer(buffer, sizeof buffer);
  writer.field(name_of(field));
  const bool volts = kind_row_of(field).form == Form::volts;
  const double most = volts ? INT32_MAX : UINT32_MAX;
  for (int i = 0; i < numbers.count; ++i) {
    const double exact = volts ? 100 * numbers[i] : numbers[i];
    const double number = exact + (exact < 0 ? -0.5 : 0.5);  // the cast below truncates
    if (!(number > INT32_MIN - 1.0 && number < most + 1)) return false;
    if (volts) {
      writer.hundredths(static_cast<std::int32_t>(number));
    } else if (number < 0) {
      writer.value(static_cast<std::int32_t>(number));
    } else {
      writer.value(static_cast<std::uint32_t>(number));
    }
  }
  Datagram datagram;
  State changed = state;
  if (!read_datagram(writer.finish(), datagram) || !read_state(datagram, changed)) return false;
  changed.present = state.present;
  state = changed;
  return true;
}

}  // namespace r4
