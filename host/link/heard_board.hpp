// SPDX-License-Identifier: GPL-3.0-or-later
// The board as its datagrams show it: the newest state, the clock, and the firmware's capabilities.
// A restart of the board clears all of these.
#pragma once

#include <cstdint>
#include <optional>

#include "../../protocol/messages/message.hpp"
#include "../measurement/board_clock.hpp"
#include "../measurement/identity_question.hpp"
#include "group_support.hpp"
#include "r4link/link.hpp"

namespace r4 {

class HeardBoard {
 public:
  // The relay of the motor supply (paper section 2).
  static constexpr int supply_relay = 1;

  // `identify_interval`: between two questions Q:ID; 0: no questions.
  explicit HeardBoard(Time identify_interval) : identify_interval_(identify_interval) {}

  // The newest datagram is a heartbeat. `t_ms`: its T; none if the board is booting.
  void on_heartbeat(SafeReason reason, std::optional<std::uint32_t> t_ms, Time now);
  // `reason`: why the board is safe; no value if a newer heartbeat has reported it.
  void on_state(const ReceivedState& state, std::optional<SafeReason> reason, Time now);
  // Returns when the question was sent; no value if this session did not ask.
  std::optional<Time> on_identity(const Identity& identity, std::uint32_t t_ms, Time now);
  void on_restart();

  const ReceivedState& state() const { return state_; }
  const BoardClock& clock() const { return clock_; }
  bool supply_is_open() const { return state_.present.has(StateField::relays) && !supply_closed(); }
  // True if relay 1 is closed; no value if the newest state does not show it, or the board is safe.
  std::optional<bool> supply() const;
  // True if the board obeys a farewell (E:LEAVE), or may obey it.
  bool may_know_leave() const { return knows_leave_.value_or(confirms()); }
  // True if the states confirm commands (CMD). The paper's release does not.
  bool confirms() const { return state_.present.has(StateField::cmd); }
  GroupSupport& groups() { return groups_; }
  const GroupSupport& groups() const { return groups_; }

  // --- Q:ID, sent for the round trip and for the board's clock

  // Time::max() for never.
  Time next_question() const;
  void ask(std::uint32_t pnum, Time now);
  // Another question is sent, for the program or for a group.
  void asked(std::uint32_t pnum, Time now);

 private:
  bool supply_closed() const { return (state_.relays & 1U << (supply_relay - 1)) != 0; }

  Time identify_interval_;
  ReceivedState state_;
  BoardClock clock_;
  IdentityQuestion question_;
  Time next_question_{0};
  Time newest_question_{0};
  int questions_of_clock_ = 0;  // sent for the clock since the board started
  std::optional<bool> knows_leave_;
  GroupSupport groups_;
};

}  // namespace r4
