// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "r4link/link.hpp"

namespace r4::tool {
namespace {

class NoteView final : public MonitorView {
 public:
  explicit NoteView(std::string& note) : note_(note) {}
  void on_event(const CarrierEvent& event) override {
    note_ = event.kind == CarrierEvent::Kind::up ? "" : event.problem.reason;
  }

 private:
  std::string& note_;
};

// "; udp://10.0.0.7:2018: silent": with several paths, the paths that do not carry.
std::string lost_paths(const AsyncBoard& board) {
  const std::vector<PathStatus> paths = board.paths();
  std::string text;
  for (const PathStatus& path : paths) {
    if (paths.size() < 2 || path.state == PathState::carrying) continue;
    text += fmt::format("; {}: {}", path.name, to_text(path.state));
  }
  return text;
}

}  // namespace

std::unique_ptr<MonitorView> BoardTable::view(std::size_t board) {
  return std::make_unique<NoteView>(notes_[board]);
}

void BoardTable::show() {
  if (!live_) {
    for (const std::string& row : rows()) lines_.write(row + "\n");
  } else if (Screen::has_room()) {
    screen_.draw(rows());
  }
}

// Boards with trouble come first, because the screen may be too short for all rows.
std::vector<std::string> BoardTable::rows() const {
  std::size_t width = 5;
  std::size_t active = 0;
  double rate = 0;
  std::vector<std::pair<bool, std::string>> rows;
  for (const SetBoard& each : boards_) width = std::max(width, each.url.size());
  for (const SetBoard& each : boards_) {
    const LinkStatus& link = each.board.link();
    const Statistics statistics = each.board.statistics();
    const std::string& note = notes_[each.index];
    const bool well = link.state == HostLinkState::active;
    active += well ? 1 : 0;
    rate += statistics.state_rate_hz;
    rows.emplace_back(
        well, fmt::format("{:<{}}  {:>7.1f} {:>8} {:>8}  {}{}{}{}", each.url, width,
                          statistics.state_rate_hz, statistics.packets.lost, statistics.damaged,
                          link_text(link), note.empty() ? "" : "; ", note, lost_paths(each.board)));
  }
  if (live_) {
    std::stable_partition(rows.begin(), rows.end(), [](const auto& row) { return !row.first; });
  }
  std::vector<std::string> lines{
      fmt::format("{} boards, {} active, {:.0f} states a second{}", boards_.size(), active, rate,
                  live_ ? "   (Ctrl-C ends)" : ""),
      fmt::format("{:<{}}  {:>7} {:>8} {:>8}  {}", "board", width, "Hz", "lost", "damaged",
                  "link")};
  for (auto& [well, text] : rows) lines.push_back(std::move(text));
  return lines;
}

}  // namespace r4::tool
