// SPDX-License-Identifier: GPL-3.0-or-later
// The answer of a board to `Q:ID`, which it gives to every host.
#pragma once

#include <optional>
#include <string>

#include "r4link/link.hpp"
#include "r4link/text.hpp"

namespace r4 {

struct IdentityAnswer : BoardIdentity {
  // True if another host than the one that asked controls it; none: the board does not report it.
  std::optional<bool> busy;
};

// The question, without a packet number: it is not part of a session.
std::string identity_question();
// None if the datagram is not a board's answer.
std::optional<IdentityAnswer> read_identity_answer(Text bytes);

}  // namespace r4
