// SPDX-License-Identifier: GPL-3.0-or-later
// Options for a board that is driven without arming, for tests of other subjects than arming.
#pragma once

#include "r4link/options.hpp"

namespace r4::test {

inline BoardOptions at_will(BoardOptions options = {}) {
  options.session.arming = Arming::off;
  return options;
}

}  // namespace r4::test
