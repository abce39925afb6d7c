// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "r4link/link.hpp"

namespace r4 {

struct Words {
  std::string reason;
  std::string fix;
};
// Why a board is safe, and how the safe state ends.
Words safe_words(const LinkStatus& link);
bool is_of_wiring(const LinkStatus& link);

}  // namespace r4
