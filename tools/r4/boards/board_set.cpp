// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_set.hpp"

#include <fmt/format.h>

#include "../shell/key_file.hpp"
#include "paths.hpp"
#include "r4link/error.hpp"
#include "r4link/link.hpp"

namespace r4::tool {

BoardSet::BoardSet(const std::vector<std::string>& patterns, const BoardOptions& options) {
  for (const PatternUrl& each : expand_urls(patterns)) add(each.url, options);
}

SetBoard& BoardSet::add(const std::string& url, const BoardOptions& options) {
  return boards_.emplace_back(io_, boards_.size(), url, options);
}

void BoardSet::open() {
  for (SetBoard& each : boards_) each.board.open();
}

void BoardSet::leave(std::chrono::milliseconds limit) {
  std::size_t left = boards_.size();
  for (SetBoard& each : boards_) {
    each.board.async_close(limit, [this, &left](const CommandResult&) {
      if (--left == 0) stop();
    });
  }
  if (left == 0) return;
  io_.restart();
  io_.run();
}

void BoardSet::require_heard() const {
  for (const SetBoard& each : boards_) {
    require_one_board(each.board);
    const Statistics statistics = each.board.statistics();
    if (statistics.received != 0) continue;
    if (statistics.damaged == 0) throw Error(explain(each.url, each.board.link()));
    throw Error(
        ErrorKind::refused, each.url,
        fmt::format("all {} datagrams were damaged", statistics.damaged),
        "check that the URL leads to an R4 board, and that both ends have the same baud rate");
  }
}

BoardOptions watching(const std::string& key, const std::string& fields,
                      const std::vector<Device>& devices) {
  BoardOptions options = with_key(key);
  options.role = BoardRole::watch;
  options.session.arming = Arming::off;
  ask_for(options, fields, devices);
  return options;
}

void ask_for(BoardOptions& options, const std::string& fields, const std::vector<Device>& devices) {
  if (!fields.empty()) options.session.fields = fields;
  for (const Device& each : devices) options.session.fields += "," + each.fields();
}

std::string whole_bus(std::string_view url) {
  constexpr std::string_view scheme = "can://";
  const bool whole =
      url.starts_with(scheme) && url.find_first_of("/?+", scheme.size()) == std::string_view::npos;
  return whole ? std::string(url.substr(scheme.size())) : std::string();
}

}  // namespace r4::tool
