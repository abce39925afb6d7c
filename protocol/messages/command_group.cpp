// SPDX-License-Identifier: GPL-3.0-or-later
#include "command_group.hpp"

#include "command_field.hpp"

namespace r4 {

// -1: no output.
int GroupRules::row_of(CommandKind kind) {
  switch (kind) {
    case CommandKind::osmc:
      return 0;
    case CommandKind::dhb12:
      return 1;
    case CommandKind::servo:
      return 2;
    case CommandKind::relay:
      return 3;
    case CommandKind::stepper:
      return 4;
    case CommandKind::zero:
      return 5;
    case CommandKind::bldc:
      return 6;
    case CommandKind::dac:
      return 7;
    case CommandKind::heartbeat:
    case CommandKind::stop:
    case CommandKind::clear:
    case CommandKind::leave:
    case CommandKind::proximity:
    case CommandKind::fields:
    case CommandKind::setting:
    case CommandKind::identify:
    case CommandKind::watch:
    case CommandKind::i2c_read:
    case CommandKind::i2c_write:
    case CommandKind::i2c_scan:
    case CommandKind::i2c_poll:
    case CommandKind::uart_write:
      break;
  }
  return -1;
}

Refusal GroupRules::add(const Command& command) {
  const int row = row_of(command.kind);
  if (row < 0 || count_ == max_group) return Refusal::format;
  const unsigned bit = 1U << static_cast<unsigned>(command.channel - 1);
  if ((taken_[row] & bit) != 0) return Refusal::format;
  taken_[row] = static_cast<std::uint16_t>(taken_[row] | bit);
  ++count_;
  return Refusal::none;
}

Refusal read_group(const Datagram& datagram, CommandGroup& out, std::uint8_t& at) {
  GroupRules rules;
  out.count = 0;
  for (const Field& field : datagram) {
    if (!is_command(field)) continue;
    at = static_cast<std::uint8_t>(out.count + 1);
    if (out.count == max_group) return Refusal::format;
    Command& command = out.commands[out.count];
    Refusal refusal = parse_command(field, command);
    if (refusal == Refusal::none) refusal = rules.add(command);
    if (refusal != Refusal::none) return refusal;
    ++out.count;
  }
  at = 0;
  return Refusal::none;
}

}  // namespace r4
