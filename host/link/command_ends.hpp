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
    switch (result.outcome) {
      case Outcome::confirmed:
        ++counts_.confirmed;
        break;
      case Outcome::refused:
      case Outcome::not_armed:
        ++counts_.refused;
        break;
      case Outcome::timed_out:
        ++counts_.timed_out;
        break;
      case Outcome::none:
      case Outcome::cancelled:
      case Outcome::closed:
      case Outcome::blocked:
      case Outcome::full:
        break;
    }
    effects_.report(CommandEnded{ticket, result});
  }

 private:
  Effects& effects_;
  Statistics& counts_;
};

}  // namespace r4
