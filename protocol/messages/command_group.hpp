// SPDX-License-Identifier: GPL-3.0-or-later
// Several commands in one datagram: a group, which the board executes wholly or not at all
// (docs/protocol.md).
//
//     O:358,1,1;O:358,1,2;PNum:2147488900;T:1699276044383;^0xc5a5ff80^
#pragma once

#include <cstddef>
#include <cstdint>

#include "r4link/command.hpp"
#include "r4link/datagram.hpp"

namespace r4 {

// The capability of a board that executes groups.
constexpr Text group_capability("group");

// What may stand side by side in a group. The same rules at both ends.
class GroupRules {
 public:
  // Refusal::none if `command`, which is valid by itself, may come next. Refusal::format if there are
  // max_group commands already, it is not an output command, or an earlier one has its channel.
  Refusal add(const Command& command);

 private:
  static constexpr std::size_t kinds =
      static_cast<std::size_t>(__builtin_popcount(kinds_that_move(CommandEffect::output)));
  static_assert(kinds_that_move(CommandEffect::output) == (1U << kinds) - 1,
                "those that join groups come first");

  int count_ = 0;
  std::uint16_t taken_[kinds] = {};  // bit n-1: channel n
};

// The commands of a group, in their order.
struct CommandGroup {
  const Command* begin() const { return commands; }
  const Command* end() const { return commands + count; }
  int count = 0;
  Command commands[max_group];
};

// Reads the commands of a datagram. Refusal::none if they can be executed together; else `at` says which
// of them it is that cannot: the first, counted from 1.
Refusal read_group(const Datagram& datagram, CommandGroup& out, std::uint8_t& at);

}  // namespace r4
