// SPDX-License-Identifier: GPL-3.0-or-later
// What the board has said of itself since it started: its newest state, its clock, and what its
// firmware can do. A restart of the board clears all of it.
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

  // `identify_interval`: from one question Q:ID to the next; 0: none is sent.
  explicit HeardBoard(Time identify_interval)
      : identify_interval_(identify_interval), question_(identify_interval) {}

  // The newest datagram is a heartbeat. `t_ms`: its T; none of a board that is booting.
  void on_heartbeat(SafeReason reason, std::optional<std::uint32_t> t_ms, Time now);
  // The newest state. `reason`: why the board is safe; none given if a heartbeat has told it later.
  void on_state(const ReceivedState& state, std::optional<SafeReason> reason, Time now);
  // The answer to Q:ID. Returns when the question was sent; none if no question of this session is
  // answered.
  std::optional<Time> on_identity(const Identity& identity, std::uint32_t t_ms, Time now);
  void on_restart();

  const ReceivedState& state() const { return state_; }
  const BoardClock& clock() const { return clock_; }
  // True if the states show that relay 1 is open.
  bool supply_is_open() const { return state_.present.has(StateField::relays) && !supply_closed(); }
  // Whether relay 1 is closed; none if the newest state does not tell it, or something keeps the
  // outputs off.
  std::optional<bool> supply() const;
  // True if the board obeys a farewell (E:LEAVE), or may.
  bool may_know_leave() const { return knows_leave_.value_or(confirms()); }
  // True if the states confirm commands (CMD). The paper's release does not.
  bool confirms() const { return state_.present.has(StateField::cmd); }
  GroupSupport& groups() { return groups_; }
  const GroupSupport& groups() const { return groups_; }

  // --- Q:ID, sent for the round trip and for the board's clock

  bool question_due(Time now) const { return question_.due(question_interval(), now); }
  Time next_question() const { return question_.next(question_interval()); }
  // The session's own question is sent, with that number.
  void ask(std::uint32_t pnum, Time now);
  // Another question is sent, for the program or for a group.
  void asked(std::uint32_t pnum, Time now) { question_.asked(pnum, now); }

 private:
  bool supply_closed() const { return (state_.relays & 1U << (supply_relay - 1)) != 0; }
  Time question_interval() const;

  Time identify_interval_;
  ReceivedState state_;
  BoardClock clock_;
  IdentityQuestion question_;
  int questions_of_clock_ = 0;  // sent for the clock since the board started
  std::optional<bool> knows_leave_;
  GroupSupport groups_;
};

}  // namespace r4
