// SPDX-License-Identifier: GPL-3.0-or-later
// The effects of a call to a session, in order: datagrams to send, then events to report.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "../../protocol/messages/message.hpp"
#include "r4link/carrier.hpp"
#include "r4link/command.hpp"
#include "r4link/link.hpp"

namespace r4 {

// Identifies a command under way; never 0.
using Ticket = std::uint64_t;

struct Sending {
  std::size_t path = 0;
  Priority priority = Priority::normal;
  CommandKind kind = CommandKind::heartbeat;
  std::uint32_t pnum = 0;
  std::string_view datagram;
};

struct StateCame {};
struct HeartbeatCame {};
struct BadDatagramCame {
  ReadResult result;
  std::string_view bytes;
};
struct CommandEnded {
  Ticket ticket = 0;
  CommandResult result;
};
// The board has restarted and kept only its stored settings. Reported before the new state.
struct BoardRestarted {};
// Views in an event point into the last received datagram, and are valid as long as its bytes.
using SessionEvent =
    std::variant<StateCame, HeartbeatCame, Identity, Nack, BadDatagramCame, LinkStatus,
                 CommandEnded, BoardRestarted, DisarmCause, RefusedPost>;

// Memory is reused: in the steady state nothing is allocated.
class Effects {
 public:
  using Room = std::array<char, max_datagram>;

  void send(std::size_t path, Priority priority, CommandKind kind, std::uint32_t pnum,
            std::string_view datagram) {
    sendings_.push({{path, priority, kind, pnum, {}}, bytes_.size(), datagram.size()});
    bytes_ += datagram;
  }
  // The last received datagram, the subject of the events.
  Datagram& datagram() { return datagram_; }
  void report(const SessionEvent& event) { events_.push(event); }
  // Reports the end of a command, and counts it.
  void end(Ticket ticket, const CommandResult& result, Statistics& counts) {
    const Outcome outcome = result.outcome;
    if (outcome == Outcome::confirmed) ++counts.confirmed;
    if (outcome == Outcome::timed_out) ++counts.timed_out;
    if (outcome == Outcome::refused || outcome == Outcome::not_armed) ++counts.refused;
    report(CommandEnded{ticket, result});
  }

  bool any_sendings() const { return sendings_.any(); }
  // The datagram is copied to `room`, because the session may add datagrams during the sending.
  Sending take_sending(Room& room) {
    Stored first = sendings_.take();
    bytes_.copy(room.data(), first.size, first.begin);
    if (!sendings_.any()) bytes_.clear();
    first.sending.datagram = {room.data(), first.size};
    return first.sending;
  }
  bool any_events() const { return events_.any(); }
  SessionEvent take_event() { return events_.take(); }

 private:
  template <class Item>
  class Queue {
   public:
    void push(Item item) { items_.push_back(std::move(item)); }
    bool any() const { return taken_ != items_.size(); }
    Item take() {
      Item item = std::move(items_[taken_]);
      if (++taken_ == items_.size()) {
        items_.clear();
        taken_ = 0;
      }
      return item;
    }

   private:
    std::vector<Item> items_;
    std::size_t taken_ = 0;
  };

  struct Stored {
    Sending sending;
    std::size_t begin = 0;  // in bytes_
    std::size_t size = 0;
  };

  Queue<Stored> sendings_;
  std::string bytes_;
  Queue<SessionEvent> events_;
  Datagram datagram_;
};

}  // namespace r4
