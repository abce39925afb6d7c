// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/error.hpp"

namespace r4 {

const char* to_text(Outcome outcome) {
  switch (outcome) {
    case Outcome::none:
      return "none";
    case Outcome::confirmed:
      return "confirmed";
    case Outcome::refused:
      return "refused";
    case Outcome::timed_out:
      return "timed out";
    case Outcome::cancelled:
      return "cancelled";
    case Outcome::closed:
      return "closed";
    case Outcome::blocked:
      return "blocked";
    case Outcome::full:
      return "full";
    case Outcome::not_armed:
      return "not armed";
  }
  return "unknown";
}

}  // namespace r4
