// SPDX-License-Identifier: GPL-3.0-or-later
// The commands and groups that were posted last, by packet number, so that a refusal of the board can be told.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "../../protocol/link/board_link.hpp"
#include "r4link/command.hpp"
#include "r4link/setpoints.hpp"

namespace r4 {

class PostedCommands {
 public:
  struct Entry {
    bool known = false;
    std::uint32_t pnum = 0;
    Command command;
    Setpoints group;  // empty: it is none
  };

  void add(std::uint32_t pnum, const Command& command) {
    Entry& entry = entries_[pnum % size];
    entry.known = true;
    entry.pnum = pnum;
    entry.command = command;
    entry.command.text = entry.command.text2 = Text();
    entry.group = Setpoints();
  }
  void add(std::uint32_t pnum, const Setpoints& group) {
    add(pnum, group[0]);
    entries_[pnum % size].group = group;
  }
  // Takes one out; nullptr if it is not known (any more). Valid until the next add().
  const Entry* take(std::uint32_t pnum) {
    Entry& entry = entries_[pnum % size];
    if (!entry.known || entry.pnum != pnum) return nullptr;
    entry.known = false;
    return &entry;
  }

 private:
  // As far back as the board remembers.
  static constexpr std::size_t size = BoardLink::memory;
  std::array<Entry, size> entries_;
};

}  // namespace r4
