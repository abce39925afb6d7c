// SPDX-License-Identifier: GPL-3.0-or-later
// Options of a board that is driven without being armed first, for tests of something else.
#pragma once

#include "r4link/options.hpp"

namespace r4::test {

inline BoardOptions at_will(BoardOptions options = {}) {
  options.session.arming = Arming::off;
  return options;
}

}  // namespace r4::test
