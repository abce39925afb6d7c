// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <fmt/format.h>

#include <utility>
#include <vector>

#include "../shell/json.hpp"
#include "r4link/async_board.hpp"
#include "r4link/error.hpp"
#include "r4link/link.hpp"

namespace r4::tool {

// ["busy","key needed"], the most serious cause first.
inline Json causes_json(LinkCauses causes) {
  Json all = Json::array();
  for (const LinkCause cause : causes) all.push_back(to_text(cause));
  return all;
}

// Throws Error{refused} that names both boards if the URLs lead to two boards.
inline void require_one_board(const AsyncBoard& board) {
  if (board.link().causes.has(LinkCause::two_boards)) throw Error(explain(board.paths()));
}

// {"name":…,"state":"carrying","busy":…,"board_id":…,"received":…,"lost":…,"loss":…,"copies":…,
//  "round_trip_ms":…,"age_ms":…}; a time that is not known is null.
inline Json path_json(const PathStatus& path) {
  const auto milliseconds = [](double us) { return us > 0 ? Json(us / 1e3) : Json(); };
  return {{"name", path.name},
          {"state", to_text(path.state)},
          {"busy", path.busy},
          {"board_id", path.board_id},
          {"received", path.packets.received},
          {"lost", path.packets.lost},
          {"loss", path.loss()},
          {"copies", path.copies},
          {"round_trip_ms", milliseconds(path.round_trip_us)},
          {"age_ms", milliseconds(path.age_us)}};
}

// With several paths, reports path changes; for a single path the link reports changes.
template <class Board, class Report>
void on_paths(Board& board, Report report) {
  if (board.paths().size() > 1) board.on_path(std::move(report));
}

inline Json paths_json(const AsyncBoard& board) {
  const std::vector<PathStatus> paths = board.paths();
  if (paths.size() < 2) return nullptr;
  Json all = Json::array();
  for (const PathStatus& path : paths) all.push_back(path_json(path));
  return all;
}

// Reports each path that is down, because a command carried by another path does not report it.
inline void tell_paths_down(const std::vector<PathStatus>& paths, bool json) {
  for (const PathStatus& path : paths) {
    if (paths.size() < 2 || path.state != PathState::down) continue;
    if (json) {
      Json line = path_json(path);
      line["type"] = "path";
      print_line(line);
    } else {
      print_trouble(fmt::format("r4: {} is down, so this path carried no datagrams", path.name));
    }
  }
}

}  // namespace r4::tool
