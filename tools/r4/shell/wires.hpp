// SPDX-License-Identifier: GPL-3.0-or-later
// What commands tell of boards to which several wires lead.
#pragma once

#include <fmt/format.h>

#include <utility>
#include <vector>

#include "json.hpp"
#include "r4link/async_board.hpp"
#include "r4link/error.hpp"
#include "r4link/link.hpp"

namespace r4::tool {

// Do the URLs that were given as wires to one board lead to two, so that nothing began?
inline bool leads_to_two_boards(const LinkStatus& link) {
  return link.two_boards && !is_heard(link.state);
}

// Throws Error{refused} that names both.
inline void require_one_board(const AsyncBoard& board) {
  if (leads_to_two_boards(board.link())) throw Error(explain(board.wires()));
}

// {"name":…,"state":"carrying","busy":…,"board_id":…,"received":…,"lost":…,"loss":…,"copies":…,"round_trip_ms":…,
//  "age_ms":…}; the last two null where nothing is known.
inline Json wire_json(const Wire& wire) {
  const auto milliseconds = [](double us) { return us > 0 ? Json(us / 1e3) : Json(); };
  return {{"name", wire.name},
          {"state", to_text(wire.state)},
          {"busy", wire.busy},
          {"board_id", wire.board_id},
          {"received", wire.packets.received},
          {"lost", wire.packets.lost},
          {"loss", wire.loss()},
          {"copies", wire.copies},
          {"round_trip_ms", milliseconds(wire.round_trip_us)},
          {"age_ms", milliseconds(wire.age_us)}};
}

// Calls `report` when a wire begins to carry, or ceases to. The link reports as much of a board's only wire.
template <class Board, class Report>
void on_wires(Board& board, Report report) {
  if (board.wires().size() > 1) board.on_wire(std::move(report));
}

// All wires. Null for the only wire, of which the link reports as much.
inline Json wires_json(const AsyncBoard& board) {
  const std::vector<Wire> wires = board.wires();
  if (wires.size() < 2) return nullptr;
  Json all = Json::array();
  for (const Wire& wire : wires) all.push_back(wire_json(wire));
  return all;
}

// Of several: those that are not there, of which a command that was carried by another one would say nothing.
inline void tell_wires_down(const std::vector<Wire>& wires, bool json) {
  for (const Wire& wire : wires) {
    if (wires.size() < 2 || wire.state != WireState::down) continue;
    if (json) {
      Json line = wire_json(wire);
      line["type"] = "wire";
      print_line(line);
    } else {
      print_trouble(fmt::format("r4: {} is down, so that nothing went by it", wire.name));
    }
  }
}

}  // namespace r4::tool
