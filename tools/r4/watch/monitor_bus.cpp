// SPDX-License-Identifier: GPL-3.0-or-later
#include "monitor_bus.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <asio/io_context.hpp>
#include <chrono>
#include <string>
#include <vector>

#include "../boards/run_end.hpp"
#include "../shell/json.hpp"
#include "../shell/output.hpp"
#include "../shell/screen.hpp"
#include "r4link/can/async_listener.hpp"
#include "r4link/messages/message.hpp"

namespace r4::tool {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t unread_of_bus = 65536;  // bytes that wait for a reader
constexpr Milliseconds bus_tick{100};
constexpr Milliseconds plain_interval{1000};
// A board without a host sends twice a second.
constexpr Milliseconds bus_patience{5000};
constexpr CanBitRate any_rate{1000000, 0};

class BusMonitor {
 public:
  explicit BusMonitor(const BusMonitorOptions& options)
      : options_(options),
        listener_(io_, options.interface, any_rate),
        run_end_(io_),
        tick_(io_),
        patience_(io_),
        live_(!options.json && ::isatty(STDOUT_FILENO) != 0) {}

  void run() {
    listener_.survey().on_datagram(
        [this](std::uint8_t node, const Datagram& datagram) { on_datagram(node, datagram); });
    listener_.survey().on_stop([this] { on_stop(); });
    listener_.on_event([this](const CarrierEvent& event) { on_event(event); });
    run_end_.watch(options_.duration);
    if (options_.count != 0 && !options_.duration) {
      patience_.after(bus_patience, [this] {
        if (!any_heard()) io_.stop();
      });
    }
    tick_.every(live_ ? bus_tick : plain_interval, [this] { show(); });
    io_.run();
    if (!any_heard()) {
      throw Error(
          ErrorKind::refused, name(), "no board was found on the bus",
          "check that boards are connected and have the bit rate of this bus, which r4 list shows");
    }
    show();
  }

 private:
  std::string name() const { return "can://" + options_.interface; }
  const HeardNode& board(std::uint8_t node) const { return listener_.survey().board(node); }
  bool any_heard() const {
    for (std::uint8_t node = 0; node < can_nodes; ++node) {
      if (board(node).heard()) return true;
    }
    return false;
  }

  void on_datagram(std::uint8_t node, const Datagram& datagram) {
    if (io_.stopped()) return;  // received together with the last state
    if (options_.json) {
      Json object{{"type", to_text(kind_of(datagram))},
                  {"transport", fmt::format("{}?node={}", name(), node)},
                  {"node", node},
                  {"pnum", datagram.pnum()},
                  {"t", datagram.time_ms()},
                  {"fields", fields_json(datagram)}};
      lines_.write(line_of(object));
    }
    if (kind_of(datagram) == MessageKind::state && ++states_ == options_.count) io_.stop();
  }
  void on_stop() {
    if (options_.json) {
      lines_.write(line_of({{"type", "emergency_stop"}, {"transport", name()}}));
    } else if (!live_) {
      lines_.write("emergency stop of a host\n");
    } else {
      ++stops_;
    }
  }
  void on_event(const CarrierEvent& event) {
    const Problem& problem = event.problem;
    const bool up = event.kind == CarrierEvent::Kind::up;
    note_ = up ? "" : problem.text();
    if (options_.json) {
      lines_.write(
          line_of({{"type", up ? "link" : "error"},
                   {"transport", name()},
                   {"fields", {{"up", up}, {"reason", problem.reason}, {"fix", problem.fix}}}}));
    } else if (!live_) {
      lines_.write(up ? name() + ": up\n" : note_ + "\n");
    }
  }

  void show() {
    if (options_.json || (live_ && !Screen::has_room())) return;
    const Clock::time_point now = Clock::now();
    const double seconds = std::chrono::duration<double>(now - shown_).count();
    if (live_ && seconds < 1 && !rows_.empty()) return;
    rows_ = table(seconds);
    shown_ = now;
    if (live_) {
      screen_.draw(rows_);
    } else {
      for (const std::string& row : rows_) lines_.write(row + "\n");
    }
  }

  std::vector<std::string> table(double seconds) {
    std::vector<std::string> rows;
    if (live_) {
      rows.push_back(fmt::format("{}   emergency stops {}   (Ctrl-C ends)", name(), stops_));
      if (!note_.empty()) rows.push_back(note_);
      rows.emplace_back();
    }
    rows.push_back(fmt::format("{:>4}  {:<18}{:>8}  {:>8}{:>9}{:>12}{:>12}", "node", "board", "Hz",
                               "lost", "damaged", "PNum", "T"));
    for (std::uint8_t node = 0; node < can_nodes; ++node) {
      const HeardNode& heard = board(node);
      if (!heard.heard()) continue;
      const std::uint64_t states = heard.states - states_before_[node];
      states_before_[node] = heard.states;
      rows.push_back(fmt::format("{:>4}  {:<18}{:>8.1f}  {:>8}{:>9}{:>12}{:>12}", node,
                                 status(heard), static_cast<double>(states) / seconds, heard.lost,
                                 heard.damaged, heard.pnum, heard.t_ms));
    }
    return rows;
  }

  static std::string status(const HeardNode& heard) {
    constexpr std::uint32_t silence_us = 1500000;  // three heartbeats
    if (CanListener::now_us() - heard.heard_us > silence_us) return "silent";
    if (heard.reason != SafeReason::none) return fmt::format("SAFE ({})", to_text(heard.reason));
    return heard.connected ? "ACTIVE" : "CONNECTING";
  }

  const BusMonitorOptions& options_;
  asio::io_context io_{1};
  CanListener listener_;
  RunEnd run_end_;
  Timer tick_;
  Timer patience_;
  const bool live_;
  LineWriter lines_{unread_of_bus};
  Screen screen_;
  std::vector<std::string> rows_;
  std::string note_;
  Clock::time_point shown_ = Clock::now();
  std::array<std::uint64_t, can_nodes> states_before_{};
  std::uint64_t states_ = 0;
  std::uint64_t stops_ = 0;
};

}  // namespace

void monitor_bus(const BusMonitorOptions& options) { BusMonitor(options).run(); }

}  // namespace r4::tool
