// SPDX-License-Identifier: GPL-3.0-or-later
#include "listed_board.hpp"

#include <fmt/format.h>

namespace r4::tool {
namespace {

// The program of this machine that has it, as far as it has said.
std::string holder_of(const ListedBoard& board) {
  if (board.program.empty()) {
    return fmt::format("held by a program (pid {}) that does not answer", board.pid);
  }
  return fmt::format("{} by {} (pid {})", board.controls ? "controlled" : "watched", board.program,
                     board.pid);
}

}  // namespace

std::optional<bool> ListedBoard::busy() const {
  if (controls || other_host) return true;
  return identity ? identity->busy : std::nullopt;
}

std::string text_of(const ListedBoard& board) {
  std::string text;
  if (board.identity) {
    text = fmt::format("id {}{}, firmware {}", board.identity->board_id,
                       board.identity->name.empty() ? "" : ", name " + board.identity->name,
                       board.identity->firmware);
  } else {
    text = "it does not tell who it is";
  }
  const std::optional<bool> busy = board.busy();
  if (busy && !board.controls) text += *busy ? ", controlled by a host" : ", free";
  if (board.foreign_frames) text += ", frames that are not R4's come on its command id";
  if (board.pid != 0) text += ", " + holder_of(board);
  return printable(text);
}

void describe(const ListedBoard& board, Json& object) {
  if (board.identity) {
    object.update({{"board_id", board.identity->board_id},
                   {"name", board.identity->name},
                   {"firmware", board.identity->firmware},
                   {"capabilities", board.identity->capabilities}});
  }
  if (const std::optional<bool> busy = board.busy()) object["busy"] = *busy;
  if (board.foreign_frames) object["foreign_frames"] = true;
  if (board.pid == 0) return;
  object["held_by"] = {
      {"program", board.program}, {"pid", board.pid}, {"controls", board.controls}};
}

}  // namespace r4::tool
