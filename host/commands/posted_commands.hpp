// SPDX-License-Identifier: GPL-3.0-or-later
// The commands that were posted last, by packet number, so that a refusal of the board can be told.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "../../protocol/link/board_link.hpp"
#include "r4link/command.hpp"

namespace r4 {

class PostedCommands {
 public:
  void add(std::uint32_t pnum, const Command& command) {
    Entry& entry = entries_[pnum % size];
    entry = {true, pnum, command};
    entry.command.text = entry.command.text2 = Text();
  }
  // Takes a command out; nullptr if it is not known (any more). Valid until the next add().
  const Command* take(std::uint32_t pnum) {
    Entry& entry = entries_[pnum % size];
    if (!entry.known || entry.pnum != pnum) return nullptr;
    entry.known = false;
    return &entry.command;
  }

 private:
  // As far back as the board remembers.
  static constexpr std::size_t size = BoardLink::memory;
  struct Entry {
    bool known = false;
    std::uint32_t pnum = 0;
    Command command;
  };
  std::array<Entry, size> entries_;
};

}  // namespace r4
