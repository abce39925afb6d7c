// SPDX-License-Identifier: GPL-3.0-or-later
#include "device_fields.hpp"

#include "../datagram/numbers.hpp"
#include "device_command.hpp"

namespace r4 {
namespace {

constexpr std::size_t value_count = 3;

bool take_values(Text values, Text (&out)[value_count]) {
  return Field(Text(), values).split(out, value_count) == value_count;
}

// Keeps an unknown number, which a newer board may send: to_text() returns "unknown".
bool parse_outcome(Text text, I2cOutcome& out) {
  std::uint32_t number = 0;
  if (!parse_number(text, number) || number > 0xFF) return false;
  out = static_cast<I2cOutcome>(number);
  return true;
}

template <int most>
bool parse_data(Text text, DeviceBytes<most>& out) {
  return parse_bytes(text, out.bytes, most, out.size) == Refusal::none;
}

}  // namespace

bool parse_device(Text values, I2cReading& out) {
  Text parts[value_count];
  return take_values(values, parts) && parse_number(parts[0], out.t_ms) &&
         parse_number(parts[1], out.errors) && parse_data(parts[2], out.data);
}

bool parse_device(Text values, I2cAnswer& out) {
  Text parts[value_count];
  return take_values(values, parts) && parse_number(parts[0], out.pnum) &&
         parse_outcome(parts[1], out.outcome) && parse_data(parts[2], out.data);
}

bool parse_device(Text values, I2cBusReport& out) {
  Text parts[value_count];
  return take_values(values, parts) && parse_outcome(parts[0], out.newest) &&
         parse_number(parts[1], out.errors) && parse_number(parts[2], out.recoveries);
}

bool parse_device(Text values, UartBytes& out) {
  Text parts[value_count];
  return take_values(values, parts) && parse_number(parts[0], out.position) &&
         parse_number(parts[1], out.lost) && parse_data(parts[2], out.data);
}

void write_device(DatagramWriter& writer, const I2cReading& reading) {
  writer.value(reading.t_ms).value(reading.errors);
  write_bytes(writer, reading.data.bytes, reading.data.size);
}

void write_device(DatagramWriter& writer, const I2cAnswer& answer) {
  writer.value(answer.pnum).value(static_cast<std::uint32_t>(answer.outcome));
  write_bytes(writer, answer.data.bytes, answer.data.size);
}

void write_device(DatagramWriter& writer, const I2cBusReport& report) {
  writer.value(static_cast<std::uint32_t>(report.newest)).value(report.errors);
  writer.value(report.recoveries);
}

void write_device(DatagramWriter& writer, const UartBytes& received) {
  writer.value(received.position).value(received.lost);
  write_bytes(writer, received.data.bytes, received.data.size);
}

}  // namespace r4
