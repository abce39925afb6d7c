// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <deque>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "../shell/json.hpp"
#include "../shell/screen.hpp"
#include "monitor_view.hpp"
#include "r4link/commands/command_text.hpp"
#include "r4link/state.hpp"

namespace r4::tool {
namespace {

constexpr std::size_t most_notes = 4;
// A board has fewer fields: further names in a state are ignored.
constexpr std::size_t most_fields = 128;
constexpr std::size_t cell_width = 24;  // "SERVO16POS          2000"

class LiveView final : public MonitorView {
 public:
  explicit LiveView(const AsyncBoard& board) : board_(board) {}

  void on_state(const ReceivedState&, const Datagram& datagram) override {
    for (const Field& field : datagram) {
      if (field.name() == Text("PNum") || field.name() == Text("T")) continue;
      if (field.name() == name_of(StateField::fault)) continue;  // shown by the first lines
      std::string name(field.name().data(), field.name().size());
      const auto known = std::find_if(fields_.begin(), fields_.end(),
                                      [&](const auto& each) { return each.first == name; });
      if (known == fields_.end() && fields_.size() == most_fields) continue;
      std::string& value =
          known != fields_.end() ? known->second : fields_.emplace_back(std::move(name), "").second;
      value.assign(field.values().data(), field.values().size());
    }
    State state;
    fault_ = read_state(datagram, state) ? state.fault : ChipFault();
    if (state.present.has(StateField::dmhsta)) has_handle_ = state.handle != Handle::none;
    pnum_ = datagram.pnum();
    t_ms_ = datagram.time_ms();
  }
  void on_heartbeat(const Datagram&) override { ++heartbeats_; }
  void on_reading(const DeviceNews& news) override {
    for (const DeviceNews::Value& value : news.values) {
      readings_[{news.device.first_slot(), news.device.text()}][value.meaning->name] =
          value_text(value);
    }
  }
  void on_device_trouble(const Problem& problem) override { note(problem.text()); }
  void on_nack(const Nack& nack, const Datagram&) override {
    if (nack.code == Refusal::busy) return;  // shown by the first line
    note(fmt::format("refused PNum {}: {}", nack.pnum, meaning_of(nack.code)));
  }
  void on_bad_datagram(const ReadResult& result, std::string_view) override {
    note(fmt::format("a damaged datagram ({})", to_text(result.error)));
  }
  void on_link(const LinkStatus& status) override { note(link_text(status)); }
  void on_event(const CarrierEvent& event) override {
    note(event.kind == CarrierEvent::Kind::up ? event.problem.thing + ": up"
                                              : event.problem.text());
  }

  void on_path(const PathStatus& path) override {
    note(fmt::format("{}: {}", path.name, to_text(path.state)));
  }

  void on_tick() override {
    if (!Screen::has_room()) return;
    std::vector<std::string> lines = status_lines();
    add_fields(lines, std::max<std::size_t>(1, Screen::columns() / cell_width));
    for (const auto& [device, values] : readings_) {
      lines.emplace_back();
      lines.push_back(device.second);
      for (const auto& [name, text] : values) lines.push_back("  " + text);
    }
    lines.emplace_back();
    for (const std::string& each : notes_) lines.push_back(each);
    screen_.draw(std::move(lines));
  }

 private:
  using Clock = std::chrono::steady_clock;

  void note(std::string text) {
    const auto seconds = std::chrono::duration<double>(Clock::now() - start_).count();
    notes_.push_back(fmt::format("{:8.1f} s  {}", seconds, printable(text)));
    if (notes_.size() > most_notes) notes_.pop_front();
  }

  std::vector<std::string> status_lines() const {
    const Statistics now = board_.statistics();
    const BoardIdentity& id = board_.identity();
    std::vector<std::string> lines;
    lines.push_back(
        fmt::format("{}   {}   (Ctrl-C ends)", board_.name(), link_text(board_.link())));
    if (!id.board_id.empty()) {
      const std::string name = id.name.empty() ? "" : " (" + id.name + ")";
      lines.push_back(fmt::format("board {}{}, firmware {}, {}", id.board_id, name, id.firmware,
                                  id.capabilities));
    }
    lines.push_back(
        fmt::format("{:.1f} Hz   lost {} ({:.2f} %)   damaged {}   round trip {:.0f} us   "
                    "jitter {:.0f} us   age {:.0f} ms",
                    now.state_rate_hz, now.packets.lost, now.loss() * 100, now.damaged,
                    now.round_trip_us, now.jitter_us, now.state_age_us / 1000));
    add_paths(lines);
    lines.push_back(fmt::format("PNum {}   T {} ms   states {}   heartbeats {} in, {} out", pnum_,
                                t_ms_, now.states, heartbeats_, now.heartbeats));
    if (!has_handle_) lines.emplace_back("the board has no dead-man's handle");
    if (fault_.any()) {
      lines.push_back(fmt::format("{}: {}", chip_name(fault_.address), to_text(fault_.trouble)));
    }
    lines.emplace_back();
    return lines;
  }

  void add_paths(std::vector<std::string>& lines) const {
    const std::vector<PathStatus> paths = board_.paths();
    if (paths.size() < 2) return;
    std::size_t width = 0;
    for (const PathStatus& path : paths) width = std::max(width, path.name.size());
    for (const PathStatus& path : paths) {
      const auto known = [](double us, std::string text) { return us > 0 ? text : "-"; };
      lines.push_back(fmt::format(
          "  {:<{}}  {:<11}  lost {} ({:.2f} %)   round trip {}   age {}   copies {}", path.name,
          width, path.busy ? "busy" : to_text(path.state), path.packets.lost, path.loss() * 100,
          known(path.round_trip_us, fmt::format("{:.0f} us", path.round_trip_us)),
          known(path.age_us, fmt::format("{:.0f} ms", path.age_us / 1000)), path.copies));
    }
  }

  void add_fields(std::vector<std::string>& lines, std::size_t columns) const {
    const std::size_t rows = (fields_.size() + columns - 1) / columns;
    for (std::size_t row = 0; row < rows; ++row) {
      std::string line;
      for (std::size_t i = row; i < fields_.size(); i += rows) {
        line += fmt::format("{:<11}{:>10}   ", fields_[i].first, fields_[i].second);
      }
      lines.push_back(std::move(line));
    }
  }

  const AsyncBoard& board_;
  const Clock::time_point start_ = Clock::now();
  std::vector<std::pair<std::string, std::string>> fields_;
  std::map<std::pair<int, std::string>, std::map<std::string, std::string>> readings_;
  std::deque<std::string> notes_;
  ChipFault fault_;
  bool has_handle_ = true;
  std::uint32_t pnum_ = 0;
  std::uint64_t t_ms_ = 0;
  std::uint64_t heartbeats_ = 0;
  Screen screen_;
};

}  // namespace

std::unique_ptr<MonitorView> make_live_view(const AsyncBoard& board) {
  return std::make_unique<LiveView>(board);
}

}  // namespace r4::tool
