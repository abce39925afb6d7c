// SPDX-License-Identifier: GPL-3.0-or-later
// The commands and groups that were posted last, by packet number, so that a refusal of the board can be told.
// It takes its memory with the first one, and that for groups with the first group: many programs post none.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "../../protocol/link/board_link.hpp"
#include "r4link/command.hpp"
#include "r4link/setpoints.hpp"

namespace r4 {

class PostedCommands {
 public:
  struct Entry {
    bool known = false;
    bool is_group = false;
    std::uint32_t pnum = 0;
    Command command;  // of a group the first
  };

  void add(std::uint32_t pnum, const Command& command) {
    if (entries_.empty()) entries_.resize(size);
    Entry& entry = entries_[pnum % size];
    entry.known = true;
    entry.is_group = false;
    entry.pnum = pnum;
    entry.command = command;
    entry.command.text = entry.command.text2 = Text();
  }
  void add(std::uint32_t pnum, const Setpoints& group) {
    add(pnum, group[0]);
    if (groups_.empty()) groups_.resize(size);
    groups_[pnum % size] = group;
    entries_[pnum % size].is_group = true;
  }
  // Takes one out; nullptr if it is not known (any more). Valid until the next add().
  const Entry* take(std::uint32_t pnum) {
    if (entries_.empty()) return nullptr;
    Entry& entry = entries_[pnum % size];
    if (!entry.known || entry.pnum != pnum) return nullptr;
    entry.known = false;
    return &entry;
  }
  // The commands of one that was taken out.
  const Setpoints& group_of(const Entry& entry) const { return groups_[entry.pnum % size]; }

 private:
  // As far back as the board remembers.
  static constexpr std::size_t size = BoardLink::memory;
  std::vector<Entry> entries_;
  std::vector<Setpoints> groups_;  // those of its entries that are some
};

}  // namespace r4
