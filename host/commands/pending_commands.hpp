// SPDX-License-Identifier: GPL-3.0-or-later
// The commands of a session that are under way: a fixed number of slots, walked in the order in
// which the commands were given. Few are ever under way at once, and a fleet has many sessions: a slot
// takes its memory when it is used for the first time, and keeps it. One is there from the beginning.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "r4link/command.hpp"
#include "r4link/setpoints.hpp"

namespace r4 {

// One command, from send() until it ends. The times are the session's.
//
//     queued --control--> sent --CMD is past it--> overtaken
//                          |                           |
//                          +-------DUPLICATE-----------+--> executed
//
// It ends out of any of them: confirmed when CMD names it, or is past it and it was executed.
//
// A group is one command as long as the board takes it as one datagram. Where it does not, each of its
// commands goes this way in turn: it is queued again when the one before is confirmed.
struct PendingCommand {
  enum class Stage : std::uint8_t {
    free,       // a slot without a command
    queued,     // not sent yet
    sent,       // and repeated
    overtaken,  // CMD is past it: the answer to a retry decides
    executed,   // the board said DUPLICATE: it has executed this number
  };
  Stage stage = Stage::free;
  CommandKind kind = CommandKind::heartbeat;
  bool cable_only = false;  // a setting that is refused elsewhere
  bool is_step = false;     // sent by arm(), not by the program
  std::uint32_t pnum = 0;
  std::uint64_t ticket = 0;
  std::int32_t cause = Command::unnamed_cause;  // clear: the cause it names, once one is known
  std::chrono::microseconds started{0}, deadline{0}, retry{0};
  std::size_t size = 0;  // of what is in `bytes`: the command's field; once sent, PNum and T too
  Command command;       // without its texts; of a group the first, or the one under way
  Setpoints group;       // empty: it is none
  // Of a group whose commands go one after the other, which of them, from 1; else 0.
  std::uint8_t step = 0;
  // Of a group that is one datagram, which of its commands the board has refused, from 1.
  std::uint8_t failed = 0;
  std::array<char, max_datagram> bytes;

  // Has a copy of it gone out?
  bool is_out() const { return stage != Stage::free && stage != Stage::queued; }
  bool is_group() const { return !group.empty(); }
  // Do more commands follow this one, one after the other?
  bool has_more() const { return step != 0 && step < group.size(); }
};

class PendingCommands {
 public:
  static constexpr std::size_t max_slots = 128;

  // At most max_slots together: `commands` and, in slots of their own, `stops`, so that no number
  // of commands can keep a stop out.
  PendingCommands(std::size_t commands, std::size_t stops)
      : slots_(commands + stops), order_(commands + stops), commands_(commands), stops_(stops) {
    for (std::size_t i = 0; i < order_.size(); ++i) order_[i] = static_cast<std::uint8_t>(i);
    slots_[0] = std::make_unique<PendingCommand>();
  }

  // A slot for a command, the last in the order, with everything reset but `bytes`; nullptr if all
  // are taken.
  PendingCommand* add(CommandKind kind) {
    std::size_t& room = room_for(kind);
    if (room == 0) return nullptr;
    --room;
    std::unique_ptr<PendingCommand>& place = slots_[order_[used_]];
    if (!place) place = std::make_unique<PendingCommand>();
    ++used_;
    PendingCommand& slot = *place;
    slot.stage = PendingCommand::Stage::queued;
    slot.is_step = false;
    slot.kind = kind;
    slot.cable_only = false;
    slot.pnum = 0;
    slot.cause = Command::unnamed_cause;
    slot.size = 0;
    slot.group = Setpoints();
    slot.step = slot.failed = 0;
    return &slot;
  }

  void remove(PendingCommand& command) {
    const auto end = order_.begin() + static_cast<std::ptrdiff_t>(used_);
    const auto at = std::find_if(
        order_.begin(), end, [&](std::uint8_t index) { return slots_[index].get() == &command; });
    std::rotate(at, at + 1, end);
    --used_;
    ++room_for(command.kind);
    command.stage = PendingCommand::Stage::free;
  }

  // Those under way now, oldest first. While they are walked, commands may be added, which are not
  // visited, and removed, which are passed over.
  class Walk {
   public:
    class Iterator {
     public:
      Iterator(const Walk& walk, std::size_t at) : walk_(walk), at_(at) { skip(); }
      PendingCommand& operator*() const { return walk_.command(at_); }
      Iterator& operator++() {
        ++at_;
        skip();
        return *this;
      }
      friend bool operator!=(const Iterator& a, const Iterator& b) { return a.at_ != b.at_; }

     private:
      void skip() {
        while (at_ < walk_.count_ && (**this).stage == PendingCommand::Stage::free) ++at_;
      }
      const Walk& walk_;
      std::size_t at_;
    };
    explicit Walk(PendingCommands& commands)
        : slots_(commands.slots_.data()), count_(commands.used_) {
      std::copy_n(commands.order_.begin(), count_, order_.begin());
    }
    Iterator begin() const { return {*this, 0}; }
    Iterator end() const { return {*this, count_}; }

   private:
    PendingCommand& command(std::size_t at) const { return *slots_[order_[at]]; }
    const std::unique_ptr<PendingCommand>* slots_;
    std::size_t count_;
    std::array<std::uint8_t, max_slots> order_;
  };
  Walk under_way() { return Walk(*this); }

 private:
  std::size_t& room_for(CommandKind kind) { return kind == CommandKind::stop ? stops_ : commands_; }

  std::vector<std::unique_ptr<PendingCommand>> slots_;  // null: not used yet
  std::vector<std::uint8_t> order_;  // of slots: those under way, oldest first, then the free ones
  std::size_t used_ = 0;
  std::size_t commands_, stops_;  // how many more
};

}  // namespace r4
