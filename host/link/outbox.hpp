// SPDX-License-Identifier: GPL-3.0-or-later
// Writes the datagrams of a session, and signs each datagram for every path.
#pragma once

#include <cstdint>
#include <optional>

#include "../../protocol/link/host_link.hpp"
#include "../measurement/time.hpp"
#include "../paths/paths.hpp"
#include "effects.hpp"
#include "host_key.hpp"
#include "r4link/command.hpp"
#include "r4link/options.hpp"
#include "r4link/setpoints.hpp"

namespace r4 {

class Outbox {
 public:
  static constexpr PathSet all_paths = 0xFF;

  // A stop always has the priority of stops.
  struct Way {
    Priority priority = Priority::normal;
    PathSet paths = all_paths;
    std::optional<std::uint32_t> echo{};  // T of the datagram, ms; empty: the host's time
    // Also sends over paths whose board is unknown, and to a board without a key.
    bool unknown_too = false;
  };
  struct Sent {
    std::uint32_t pnum = 0;
    PathSet paths = 0;
  };

  Outbox(Effects& effects, HostLink& link, HostKey& key, Paths& paths, BoardRole role)
      : effects_(effects), link_(link), key_(key), paths_(paths), role_(role) {}

  Sent send(const Command& command, Way way, Time now);
  Sent send(const Setpoints& group, Time now);
  // Sends a stamped command. A stop is sent on every path. If the host has a key and the board has
  // no key, only stops are sent. Otherwise all commands are sent on paths to the session's board.
  PathSet send(DatagramWriter& writer, CommandKind kind, std::uint32_t pnum, Way way, Time now);

  // Writes SID, PNum and, in a datagram with an echo, T.
  void stamp(DatagramWriter& writer, CommandKind kind, std::uint32_t pnum,
             std::uint32_t t_ms) const;

  BoardRole role() const { return role_; }
  void change_role(BoardRole role) { role_ = role; }
  bool watches() const { return role_ == BoardRole::watch; }
  SessionId session_id() const { return watches() ? no_session : link_.session(); }

 private:
  Effects& effects_;
  HostLink& link_;
  HostKey& key_;
  Paths& paths_;
  BoardRole role_;
};

class Delivery {
 public:
  void begin(Outbox::Sent sent);
  bool on_sent(const Sending& sending, SendResult result);
  bool failed() const { return open_ == 0 && result_ != SendResult::sent; }
  // `sent` as soon as one path has taken the datagram; before that, the first result but `down`.
  SendResult result() const { return result_; }
  std::uint32_t pnum() const { return pnum_; }

 private:
  std::uint32_t pnum_ = 0;
  int open_ = 0;
  SendResult result_ = SendResult::down;
};

}  // namespace r4
