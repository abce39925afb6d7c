// SPDX-License-Identifier: GPL-3.0-or-later
#include "command_group.hpp"

#include "command_field.hpp"

namespace r4 {

Refusal GroupRules::add(const Command& command) {
  if (!joins_groups(command.kind) || count_ == max_group) return Refusal::format;
  std::uint16_t& taken = taken_[static_cast<std::size_t>(command.kind)];
  const unsigned bit = 1U << static_cast<unsigned>(command.channel - 1);
  if ((taken & bit) != 0) return Refusal::format;
  taken = static_cast<std::uint16_t>(taken | bit);
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
