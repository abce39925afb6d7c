// SPDX-License-Identifier: GPL-3.0-or-later
// A group: commands in one datagram, executed all or none (docs/reference/protocol.md).
//     O:358,1,1;O:358,1,2;PNum:2147488900;T:1699276044383;^0xc5a5ff80^
#pragma once

#include <cstddef>
#include <cstdint>

#include "r4link/command.hpp"
#include "r4link/datagram.hpp"

namespace r4 {

constexpr Text group_capability("group");

class GroupRules {
 public:
  // Refusal::none if `command`, valid by itself, may be added. Refusal::format if the group is full
  // (max_group), `command` is not an output command, or its output is already in the group.
  Refusal add(const Command& command);

 private:
  static constexpr std::size_t kinds =
      static_cast<std::size_t>(__builtin_popcount(kinds_that_move(CommandEffect::output)));
  static_assert(kinds_that_move(CommandEffect::output) == (1U << kinds) - 1,
                "the kinds that join groups come first");

  int count_ = 0;
  std::uint16_t taken_[kinds] = {};  // bit n-1: channel n
};

struct CommandGroup {
  const Command* begin() const { return commands; }
  const Command* end() const { return commands + count; }
  int count = 0;
  Command commands[max_group];
};

// If the commands cannot be executed together, `at` is the first wrong command, from 1.
Refusal read_group(const Datagram& datagram, CommandGroup& out, std::uint8_t& at);

}  // namespace r4
