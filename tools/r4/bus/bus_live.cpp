// SPDX-License-Identifier: GPL-3.0-or-later
#include "bus_live.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <asio/io_context.hpp>
#include <chrono>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "../boards/run_end.hpp"
#include "../shell/json.hpp"
#include "../shell/screen.hpp"
#include "foreign_ids.hpp"
#include "r4link/can/async_listener.hpp"
#include "r4link/can/can_interface.hpp"
#include "r4link/discovery/url.hpp"

namespace r4::tool {
namespace {

using Clock = std::chrono::steady_clock;

constexpr Milliseconds usual_duration{5000};
constexpr Milliseconds interval{1000};

std::string meaning_of_id(const CanSurvey& survey, std::uint32_t id) {
  if (id == CanSurvey::extended_ids) return "ids of 29 bits";
  const CanIdMeaning meaning = classify(id);
  if (!survey.is_r4(id)) {
    const bool is_ours = meaning.kind != CanIdKind::other;
    return (is_ours ? "not an R4 datagram: " : "not R4: ") + foreign_names(id);
  }
  switch (meaning.kind) {
    case CanIdKind::emergency_stop:
      return "emergency stop";
    case CanIdKind::went_safe:
      return fmt::format("board {} went safe", meaning.node);
    case CanIdKind::command:
      return fmt::format("host to board {}", meaning.node);
    case CanIdKind::reply:
      return fmt::format("answers of board {}", meaning.node);
    case CanIdKind::telemetry:
      return fmt::format("states of board {}", meaning.node);
    case CanIdKind::watch:
      return fmt::format("watchers of board {}", meaning.node);
    case CanIdKind::other:
      break;
  }
  return "";
}

struct Window {
  std::map<std::uint32_t, CanTraffic> traffic;
  CanTraffic total;
  double seconds = 0;

  double load(const CanTraffic& part) const {
    return static_cast<double>(part.busy_ns) / (seconds * 1e9);
  }
};

class LiveBus {
 public:
  LiveBus(const LiveBusOptions& options, double nearly_full)
      : options_(options),
        nearly_full_(nearly_full),
        interface_(interface_of(options.url)),
        rate_{rate_of("--bitrate", options.bit_rate, interface_.bit_rate, usual_bit_rate),
              rate_of("--dbitrate", options.data_bit_rate, interface_.data_bit_rate, 0)},
        listener_(io_, interface_.name, checked(rate_)),
        run_end_(io_),
        timer_(io_),
        live_(!options.json && !options.duration && ::isatty(STDOUT_FILENO) != 0) {}

  void run() {
    // A live table shows only a current problem. A report also shows a past problem.
    listener_.on_event([this](const CarrierEvent& event) {
      if (listener_.in_trouble()) {
        problem_ = event.problem.text();
      } else if (live_) {
        problem_.clear();
      }
    });
    run_end_.watch();
    if (live_) {
      timer_.every(interval, [this] { draw(); });
    } else {
      timer_.after(options_.duration.value_or(usual_duration), [this] { io_.stop(); });
    }
    io_.run();
    if (live_) return;
    const Window window = look();
    if (options_.json) {
      print_json(window);
    } else {
      for (const std::string& row : table(window)) print_text(row + "\n");
    }
    for (const std::string& trouble : troubles()) print_trouble("r4: warning: {}", trouble);
    if (window.load(window.total) > nearly_full_) {
      print_trouble("r4: warning: {}", fullness(window));
    }
  }

 private:
  static CanInterface interface_of(const std::string& text) {
    const Url url = Url::parse(text);
    const std::string& name = can_interface_of(url);
    if (text.find('?') != std::string::npos) {
      throw Error(ErrorKind::usage, text,
                  "r4 bus counts all frames on a bus, not those of one board",
                  fmt::format("write can://{}", name));
    }
    return can_interface(name);
  }
  std::uint32_t rate_of(const char* option, const std::optional<std::uint32_t>& given,
                        std::uint32_t known, std::uint32_t usual) const {
    if (known != 0 && given && *given != known) {
      throw Error(ErrorKind::usage, fmt::format("{} {}", option, *given),
                  fmt::format("the controller of {} is set to {}", interface_.name, known),
                  "remove the option");
    }
    return known != 0 ? known : given.value_or(usual);
  }
  const CanBitRate& checked(const CanBitRate& rate) const {
    if (rate.data != 0 && !interface_.fd && interface_.exists) {
      throw Error(ErrorKind::usage, fmt::format("--dbitrate {}", rate.data),
                  interface_.name + " is not set up for CAN FD", "remove the option");
    }
    if (rate.data != 0 && rate.data < rate.nominal) {
      throw Error(ErrorKind::usage, fmt::format("--dbitrate {}", rate.data),
                  "is below the nominal bit rate",
                  fmt::format("write {} or more, or a lower --bitrate", rate.nominal));
    }
    return rate;
  }

  void draw() {
    if (!Screen::has_room()) return;
    const Window window = look();
    std::vector<std::string> rows = table(window);
    if (window.load(window.total) > nearly_full_) rows.push_back("warning: " + fullness(window));
    for (const std::string& trouble : troubles()) rows.push_back(trouble);
    screen_.draw(std::move(rows));
  }

  Window look() {
    Window window;
    const Clock::time_point now = Clock::now();
    window.seconds = std::chrono::duration<double>(now - std::exchange(looked_, now)).count();
    for (const auto& [id, traffic] : listener_.survey().traffic()) {
      CanTraffic& before = before_[id];
      const CanTraffic part{traffic.frames - before.frames, traffic.bits - before.bits,
                            traffic.busy_ns - before.busy_ns};
      before = traffic;
      window.total.frames += part.frames;
      window.total.bits += part.bits;
      window.total.busy_ns += part.busy_ns;
      window.traffic[id] = part;
    }
    return window;
  }

  std::vector<std::string> table(const Window& window) const {
    std::vector<std::string> rows;
    rows.push_back(fmt::format("{} at {} kbit/s, {:.1f} s", options_.url, rate_.nominal / 1000.0,
                               window.seconds));
    rows.emplace_back();
    rows.push_back(fmt::format("{:<26}{:>12}{:>12}{:>11}", "id", "frames/s", "bit/s", "load"));
    const auto add = [&](const std::string& name, const CanTraffic& part) {
      rows.push_back(fmt::format("{:<26}{:>12.0f}{:>12.0f}{:>9.1f} %", name,
                                 static_cast<double>(part.frames) / window.seconds,
                                 static_cast<double>(part.bits) / window.seconds,
                                 100 * window.load(part)));
    };
    for (const auto& [id, part] : window.traffic) {
      const std::string number = id > max_can_id ? "" : fmt::format("{:03X}  ", id);
      add(number + meaning_of_id(listener_.survey(), id), part);
    }
    add("total", window.total);
    return rows;
  }

  void print_json(const Window& window) const {
    const auto object = [&](const char* type, const CanTraffic& part) {
      return Json{{"type", type},
                  {"frames", static_cast<double>(part.frames) / window.seconds},
                  {"bits", static_cast<double>(part.bits) / window.seconds},
                  {"load", window.load(part)}};
    };
    for (const auto& [id, part] : window.traffic) {
      Json row = object("traffic", part);
      row["id"] = id > max_can_id ? Json() : Json(id);
      row["name"] = meaning_of_id(listener_.survey(), id);
      print_line(row);
    }
    Json bus = object("bus", window.total);
    bus["transport"] = options_.url;
    bus["seconds"] = window.seconds;
    bus["bitrate"] = rate_.nominal;
    bus["dbitrate"] = rate_.data;
    bus["nearly_full"] = window.load(window.total) > nearly_full_;
    print_line(bus);
  }

  std::vector<std::string> troubles() const {
    std::vector<std::string> found;
    if (!problem_.empty()) found.push_back(problem_);
    if (interface_.has_controller && interface_.bit_rate == 0 && !options_.bit_rate) {
      found.push_back(fmt::format(
          "{}: the interface does not report its bit rate, so {} kbit/s is assumed; add "
          "--bitrate",
          options_.url, rate_.nominal / 1000.0));
    }
    if (rate_.data == 0 && listener_.heard_rate_switch()) {
      found.push_back(
          fmt::format("{}: CAN FD frames switch their bit rate, but all their bits are counted at "
                      "{} kbit/s; add --dbitrate with the rate of the data phase",
                      options_.url, rate_.nominal / 1000.0));
    }
    return found;
  }

  std::string fullness(const Window& window) const {
    const double load = window.load(window.total);
    return fmt::format(
        "{}: {}, {:.1f} % of its time is used; use fewer boards, fields or states, or "
        "pack=1 instead of pack=0",
        options_.url,
        load > 1 ? fmt::format("more than a bus of {} kbit/s carries", rate_.nominal / 1000.0)
                 : "nearly full",
        100 * load);
  }

  const LiveBusOptions& options_;
  const double nearly_full_;
  const CanInterface interface_;
  const CanBitRate rate_;
  asio::io_context io_{1};
  CanListener listener_;
  RunEnd run_end_;
  Timer timer_;
  const bool live_;
  Screen screen_;
  std::string problem_;
  Clock::time_point looked_ = Clock::now();
  std::map<std::uint32_t, CanTraffic> before_;
};

}  // namespace

void show_live_bus(const LiveBusOptions& options, double nearly_full) {
  LiveBus(options, nearly_full).run();
}

}  // namespace r4::tool
