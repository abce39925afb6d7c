// SPDX-License-Identifier: GPL-3.0-or-later
// A session's commands under way, in a fixed number of slots and in the order of the calls. A slot
// is allocated at its first use, because a fleet has many sessions with few commands each.
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

// One command, from send() to its end. The times are the session's.
//     queued --control--> sent --CMD is past it--> overtaken
//                          |                           |
//                          +-------DUPLICATE-----------+--> executed
//
// A command may end in any of these states. A command is confirmed when CMD names it, or when CMD
// has passed it and it was executed. After its end, a stop is still repeated:
//     sent --confirmed, timed out--> lingering --its time is over, another stop, E:CLEAR--> free
//
// A group that is sent one by one passes through these states once for each command.
struct PendingCommand {
  enum class Stage : std::uint8_t {
    free,
    queued,
    sent,       // and repeated
    overtaken,  // CMD has passed the command: the answer to a retry decides
    executed,   // the board answered DUPLICATE
    lingering,  // a stop whose end was reported, and which is repeated
  };
  Stage stage = Stage::free;
  CommandKind kind = CommandKind::heartbeat;
  bool cable_only = false;  // the board accepts this setting only over a cable
  bool is_step = false;     // sent by arm(), not by the program
  std::uint32_t pnum = 0;
  std::uint64_t ticket = 0;
  std::int32_t cause = Command::unnamed_cause;  // clear: the named cause
  std::chrono::microseconds started{0}, deadline{0}, retry{0};
  std::size_t size = 0;  // of the fields in `bytes`: the command; if sent, also PNum and T
  Command command;       // without texts; of a group, the first command or the command under way
  Setpoints group;       // empty for a single command
  // The current command, from 1, of a group that is sent one by one; else 0.
  std::uint8_t step = 0;
  // The refused command, from 1, of a group in one datagram.
  std::uint8_t failed = 0;
  std::array<char, max_datagram> bytes;

  bool is_out() const {
    return stage != Stage::free && stage != Stage::queued && stage != Stage::lingering;
  }
  bool is_group() const { return !group.empty(); }
  bool has_more() const { return step != 0 && step < group.size(); }
};

class PendingCommands {
 public:
  static constexpr std::size_t max_slots = 128;

  // At most max_slots in total. Stops have separate slots, so other commands cannot block a stop.
  PendingCommands(std::size_t commands, std::size_t stops)
      : slots_(commands + stops), commands_(commands), stops_(stops) {
    slots_[0] = std::make_unique<PendingCommand>();
  }

  // Returns nullptr if all slots are taken.
  PendingCommand* add(CommandKind kind) {
    std::size_t& room = room_for(kind);
    if (room == 0) return nullptr;
    --room;
    std::unique_ptr<PendingCommand>& slot = slots_[used_++];
    if (!slot) slot = std::make_unique<PendingCommand>();
    *slot = PendingCommand();
    slot->stage = PendingCommand::Stage::queued;
    slot->kind = kind;
    return slot.get();
  }

  void remove(PendingCommand& command) {
    const auto end = slots_.begin() + static_cast<std::ptrdiff_t>(used_);
    const auto at =
        std::find_if(slots_.begin(), end, [&](const auto& slot) { return slot.get() == &command; });
    std::rotate(at, at + 1, end);
    --used_;
    ++room_for(command.kind);
    command.stage = PendingCommand::Stage::free;
  }

  // Oldest first. Commands added during a walk are not visited, and removed commands are skipped.
  class Walk {
   public:
    class Iterator {
     public:
      Iterator(PendingCommand* const* at, PendingCommand* const* end) : at_(at), end_(end) {
        skip();
      }
      PendingCommand& operator*() const { return **at_; }
      Iterator& operator++() {
        ++at_;
        skip();
        return *this;
      }
      bool operator==(const Iterator& other) const { return at_ == other.at_; }

     private:
      void skip() {
        while (at_ != end_ && (*at_)->stage == PendingCommand::Stage::free) ++at_;
      }
      PendingCommand* const* at_;
      PendingCommand* const* end_;
    };
    explicit Walk(const PendingCommands& commands) : count_(commands.used_) {
      for (std::size_t i = 0; i < count_; ++i) commands_[i] = commands.slots_[i].get();
    }
    Iterator begin() const { return {commands_.data(), commands_.data() + count_}; }
    Iterator end() const { return {commands_.data() + count_, commands_.data() + count_}; }

   private:
    std::size_t count_;
    std::array<PendingCommand*, max_slots> commands_;
  };
  Walk under_way() const { return Walk(*this); }

 private:
  std::size_t& room_for(CommandKind kind) { return kind == CommandKind::stop ? stops_ : commands_; }

  // Commands under way, oldest first, then free slots. A slot that was never used is null.
  std::vector<std::unique_ptr<PendingCommand>> slots_;
  std::size_t used_ = 0;
  std::size_t commands_, stops_;  // free slots
};

}  // namespace r4
