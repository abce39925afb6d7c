// SPDX-License-Identifier: GPL-3.0-or-later
// A board's answer to `Q:ID`, which the board sends to every host.
#pragma once

#include <optional>
#include <string>

#include "r4link/link.hpp"
#include "r4link/text.hpp"

namespace r4 {

struct IdentityAnswer : BoardIdentity {
  // True if a host other than the asking host controls the board; none: not reported.
  std::optional<bool> busy;
};

// The question, without a packet number, because it is not part of a session.
std::string identity_question();
std::optional<IdentityAnswer> read_identity_answer(Text bytes);

}  // namespace r4
