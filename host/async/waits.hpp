// SPDX-License-Identifier: GPL-3.0-or-later
// Handlers that wait for the end of a command or for a condition. Ended waits are kept until taken.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "../link/effects.hpp"
#include "r4link/link.hpp"

namespace r4 {

template <class CompletionPtr>
class Waits {
 public:
  enum class For : std::uint8_t {
    active,  // the link is active or, for a watcher, safe
    answer,  // the state has the answer to the I2C transfer `pnum`
    time,    // the deadline
  };
  struct Condition {
    For what = For::active;
    Ticket id = 0;
    std::uint32_t pnum = 0;
    Time started{0};
    Time deadline{0};
    CompletionPtr completion;
  };
  struct Ended {
    CommandResult result;
    CompletionPtr completion;
  };

  // Adds a command. `id`: the ticket of the first step, which cancels the command.
  void add(Ticket ticket, Ticket id, CompletionPtr completion) {
    commands_.push_back({ticket, id, std::move(completion)});
  }
  void add(Condition condition) { conditions_.push_back(std::move(condition)); }
  // An id that is not a ticket of a session.
  Ticket next_id() { return next_id_++; }

  void end(Ticket ticket, const CommandResult& result) {
    const auto found = std::find_if(commands_.begin(), commands_.end(),
                                    [&](const Command& each) { return each.ticket == ticket; });
    if (found == commands_.end()) return;
    ended_.push_back({result, std::move(found->completion)});
    commands_.erase(found);
  }
  // Ends each condition for which `outcome_of` returns an outcome. True if a condition ended.
  template <class OutcomeOf>
  bool end_conditions(OutcomeOf outcome_of, Time now) {
    const std::size_t before = conditions_.size();
    std::erase_if(conditions_, [&](Condition& each) {
      const std::optional<Outcome> outcome = outcome_of(std::as_const(each));
      if (outcome) {
        ended_.push_back(
            {{*outcome, Refusal::none, now - each.started}, std::move(each.completion)});
      }
      return outcome.has_value();
    });
    return conditions_.size() != before;
  }
  // Ends the condition. Returns the ticket of the command that the session must cancel; 0: none.
  Ticket cancel(Ticket id, Time now) {
    end_conditions(
        [id](const Condition& each) {
          return each.id == id ? std::optional(Outcome::cancelled) : std::nullopt;
        },
        now);
    const auto found = std::find_if(commands_.begin(), commands_.end(),
                                    [&](const Command& each) { return each.id == id; });
    return found == commands_.end() ? 0 : found->ticket;
  }
  std::optional<Ended> take_ended() {
    if (ended_.empty()) return std::nullopt;
    std::optional<Ended> first(std::move(ended_.front()));
    ended_.erase(ended_.begin());
    return first;
  }
  Time next(Time latest) const {
    for (const Condition& each : conditions_) latest = std::min(latest, each.deadline);
    return latest;
  }

 private:
  struct Command {
    Ticket ticket = 0;
    Ticket id = 0;
    CompletionPtr completion;
  };

  std::vector<Command> commands_;
  std::vector<Condition> conditions_;
  std::vector<Ended> ended_;
  Ticket next_id_ = Ticket{1} << 63;
};

}  // namespace r4
