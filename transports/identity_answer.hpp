// SPDX-License-Identifier: GPL-3.0-or-later
// Who a board is, as it tells anyone who asks `Q:ID`, whoever controls it.
#pragma once

#include <optional>
#include <string>

#include "r4link/link.hpp"
#include "r4link/text.hpp"

namespace r4 {

struct IdentityAnswer : BoardIdentity {
  std::optional<bool>
      busy;  // another host than the one that asked controls it; none: it does not tell
};

// The question, without a number: nobody's session goes on by it.
std::string identity_question();
// A board's answer. None if it is something else.
std::optional<IdentityAnswer> read_identity_answer(Text bytes);

}  // namespace r4
