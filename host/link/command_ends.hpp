// SPDX-License-Identifier: GPL-3.0-or-later
// Counts how commands end, and reports each end.
#pragma once

#include "effects.hpp"
#include "r4link/link.hpp"

namespace r4 {

class CommandEnds {
 public:
  CommandEnds(Effects& effects, Statistics& counts) : effects_(effects), counts_(counts) {}

  void end(Ticket ticket, const CommandResult& result) {
    const Outcome outcome = result.outcome;
    if (outcome == Outcome::confirmed) ++counts_.confirmed;
    if (outcome == Outcome::timed_out) ++counts_.timed_out;
    if (outcome == Outcome::refused || outcome == Outcome::not_armed) ++counts_.refused;
    effects_.report(CommandEnded{ticket, result});
  }

 private:
  Effects& effects_;
  Statistics& counts_;
};

}  // namespace r4
