// SPDX-License-Identifier: GPL-3.0-or-later
#include "messages.hpp"

#include <fmt/format.h>

#include <cmath>
#include <iterator>
#include <limits>

#include "../boards/paths.hpp"
#include "r4link/config.hpp"

namespace r4::tool::web {
namespace {

const char* level_text(WebBoard::Level level) {
  switch (level) {
    case WebBoard::Level::info:
      return "info";
    case WebBoard::Level::warning:
      return "warning";
    default:
      return "error";
  }
}

}  // namespace

void Rows::add(const Datagram& state, std::int64_t time_ms) {
  constexpr std::size_t most = 64;
  const std::uint64_t board_ms = state.has_time() ? state.time_ms() : 0;
  const bool part = !rows_.empty() && state.has_time() && rows_.back().board_ms == board_ms;
  if (!part) {
    if (rows_.size() == most) rows_.erase(rows_.begin());
    rows_.push_back(
        {time_ms, board_ms,
         std::vector<double>(columns_.size(), std::numeric_limits<double>::quiet_NaN())});
  }
  columns_.fill(state, rows_.back().values);
}

void Rows::take(std::string& out) {
  const auto end = std::back_inserter(out);
  out += '[';
  for (const Row& row : rows_) {
    if (&row != rows_.data()) out += ',';
    fmt::format_to(end, "[{}", row.time_ms);
    for (const double value : row.values) {
      if (std::isnan(value)) {
        out += ",null";
      } else {
        fmt::format_to(end, ",{}", value);
      }
    }
    out += ']';
  }
  out += ']';
  rows_.clear();
}

std::string hello_text(const Columns& columns, const std::vector<WebBoard*>& boards,
                       std::uint32_t you, std::int64_t clock_ms) {
  Json list = Json::array();
  for (std::size_t i = 0; i < boards.size(); ++i) {
    list.push_back({{"board", i}, {"url", boards[i]->url()}, {"name", boards[i]->identity().name}});
  }
  std::string text = text_of({{"type", "hello"},
                              {"version", R4LINK_VERSION},
                              {"boards", std::move(list)},
                              {"fields", columns.names()},
                              {"units", columns.units()},
                              {"you", you},
                              {"clock_ms", clock_ms}});
  // Made once, because the channels are most of the work, and many clients would delay the loop.
  static const std::string channels = text_of(channels_json());
  text.pop_back();
  return text + R"(,"channels":)" + channels + '}';
}

std::string board_text(std::size_t number, WebBoard& slot) {
  const BoardIdentity& who = slot.identity();
  Json object{{"type", "board"},
              {"board", number},
              {"name", who.name},
              {"firmware", who.firmware},
              {"id", who.board_id}};
  const AsyncBoard& board = slot.board();
  const LinkStatus& link = board.link();
  const Statistics statistics = board.statistics();
  const bool heard = is_heard(link.state);
  const bool fine = link.state == HostLinkState::active && (!slot.controlling() || link.in_control);
  object["link"] = link.causes.has(LinkCause::transport_down) ? "down" : to_text(link.state);
  object["causes"] = causes_json(link.causes);
  const bool free = !slot.controlling() && heard && link.reason == SafeReason::link;
  object["why"] = fine   ? ""
                  : free ? "no host controls the board"
                         : explain(slot.url(), link).reason;
  object["controlled"] = link.in_control;
  object["armed"] = slot.controlling() && board.disarmed_by() == DisarmCause::none;
  object["disarmed"] = slot.controlling() ? to_text(board.disarmed_by()) : "";
  object["safe"] = heard && link.reason != SafeReason::none ? to_text(link.reason) : "";
  object["rate_hz"] = std::round(statistics.state_rate_hz * 10) / 10;
  object["loss"] = statistics.loss();
  object["round_trip_ms"] = statistics.round_trip_us / 1e3;
  object["age_ms"] = statistics.state_age_us / 1e3;
  if (Json paths = paths_json(board); !paths.is_null()) object["paths"] = std::move(paths);
  return text_of(object);
}

std::string event_text(std::size_t board, WebBoard::Level level, const std::string& text,
                       std::int64_t time_ms) {
  return text_of({{"type", "event"},
                  {"time_ms", time_ms},
                  {"board", board},
                  {"level", level_text(level)},
                  {"text", text}});
}

std::string result_text(std::uint64_t request, std::size_t board, bool ok, double ms,
                        const std::string& text) {
  return text_of({{"type", "result"},
                  {"request", request},
                  {"board", board},
                  {"ok", ok},
                  {"ms", ms},
                  {"text", text}});
}

std::string error_text(const std::string& text) {
  return text_of({{"type", "error"}, {"text", text}});
}

}  // namespace r4::tool::web
