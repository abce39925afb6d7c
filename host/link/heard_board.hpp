// SPDX-License-Identifier: GPL-3.0-or-later
// The board's newest state, clock and capabilities. A restart of the board clears all of them.
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
  // Closes the motor supply (paper section 2).
  static constexpr int supply_relay = 1;

  // `identify_interval`: period of Q:ID; 0: Q:ID is not sent.
  explicit HeardBoard(Time identify_interval) : identify_interval_(identify_interval) {}

  // The newest datagram is a heartbeat. `t_ms`: its T; empty if the board is booting.
  void on_heartbeat(SafeReason reason, std::optional<std::uint32_t> t_ms, Time now);
  // `reason`: why the board is safe; empty if a newer heartbeat has reported it.
  void on_state(const ReceivedState& state, std::optional<SafeReason> reason, Time now);
  // Returns the time of the question; empty if this session did not ask.
  std::optional<Time> on_identity(const Identity& identity, std::uint32_t t_ms, Time now);
  void on_restart();

  const ReceivedState& state() const { return state_; }
  const BoardClock& clock() const { return clock_; }
  bool supply_is_open() const { return state_.present.has(StateField::relays) && !supply_closed(); }
  // True if relay 1 is closed; empty if the newest state does not show it, or the board is safe.
  std::optional<bool> supply() const;
  // True if the board obeys or may obey a farewell (E:LEAVE).
  bool may_know_leave() const { return knows_leave_.value_or(confirms()); }
  // True if the states confirm commands (CMD). Boards of the paper's release do not.
  bool confirms() const { return state_.present.has(StateField::cmd); }
  GroupSupport& groups() { return groups_; }
  const GroupSupport& groups() const { return groups_; }

  // --- Q:ID, sent for the round trip and for the board's clock

  // Time::max() for never.
  Time next_question() const;
  void ask(std::uint32_t pnum, Time now);
  // A Q:ID was sent, because the program asked, or to learn whether the board executes groups.
  void asked(std::uint32_t pnum, Time now) {
    newest_question_ = now;
    question_.asked(pnum, now);
  }

 private:
  bool supply_closed() const { return (state_.relays & 1U << (supply_relay - 1)) != 0; }

  Time identify_interval_;
  ReceivedState state_;
  BoardClock clock_;
  IdentityQuestion question_;
  Time next_question_{0};
  Time newest_question_{0};
  int questions_of_clock_ = 0;  // questions for the clock since the board started
  std::optional<bool> knows_leave_;
  GroupSupport groups_;
};

}  // namespace r4
