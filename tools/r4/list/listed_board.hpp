// SPDX-License-Identifier: GPL-3.0-or-later
// What r4 list has heard of a board: who it is, and who has it.
#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "../shell/json.hpp"
#include "transports/identity_answer.hpp"

namespace r4::tool {

// How a board that can be heard is asked who it is.
constexpr std::chrono::milliseconds between_questions{150};
constexpr int most_questions = 3;

struct ListedBoard {
  std::optional<IdentityAnswer> identity;
  // The program of this machine that holds the transport.
  int pid = 0;          // 0: none
  std::string program;  // empty: it has not answered
  bool controls = false;
  // A host that is not that program was heard on the bus.
  bool other_host = false;
  // Frames of another protocol come on its command id, so that it was not asked.
  bool foreign_frames = false;

  // Both the board and the program that holds the transport have answered.
  bool is_known() const { return identity && (pid == 0 || !program.empty()); }
  // Does a host control it? None: it is not known.
  std::optional<bool> busy() const;
};

// "id 0042af…, name left-arm, firmware 0.1.0, free", or "it does not tell who it is".
std::string text_of(const ListedBoard& board);
// Puts the same into its object.
void describe(const ListedBoard& board, Json& object);

}  // namespace r4::tool
