// SPDX-License-Identifier: GPL-3.0-or-later
// r4 demo: plays and explains section 4.4 of the paper over every transport of this machine.
#include <fmt/format.h>

#include <array>
#include <asio/io_context.hpp>
#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "../shell/json.hpp"
#include "../shell/options.hpp"
#include "../shell/subcommands.hpp"
#include "child_board.hpp"
#include "demo_story.hpp"
#include "protocol/messages/message.hpp"
#include "r4link/can/can_ids.hpp"
#include "r4link/can/can_interface.hpp"
#include "r4link/datagram.hpp"
#include "r4link/error.hpp"
#include "transports/can/can_socket.hpp"

namespace r4::tool {
namespace {

struct DemoOptions {
  bool json = false;
};

constexpr const char* introduction = R"(R4 in a few lines
  An R4 board drives motors, servos and relays and reads sensors. A program, the host, talks to it in
  lines of text, datagrams. Each ends with a checksum, so a damaged one is noticed and thrown away.
  Both sides number their datagrams and send heartbeats: if the host's stay away for a second, the
  board switches every output off. The same datagrams go over WiFi, USB serial, CAN or within a program.

1. What was on the wire
  Captured from a real board (paper, section 4.4), read by this program:
)";

struct Captured {
  const char* bytes;
  const char* meaning;
  bool good;
};
constexpr std::array<Captured, 4> captured{{
    {"AIN24:24.28;AIN12:12.16;AIN5:5.11;AINDMH:12.19;DMHSTA:1;AINSTEER:1.03;DHB1A:4095,1;OSMC1:400,"
     "1;"
     "STEP1POS:-100;SERVO1POS:2000;PNum:7439;T:79140;^0x71b76fdb^",
     "a state: 24.28 V from the battery, motor OSMC1 at 400 of 4095, forward", true},
    {"O:358,1,1;PNum:66;T:1699276044383;^0x7fefae81^",
     "a command of the host: motor 1 to 358, forward", true},
    {"H:R4-ROS2;PNum:7446;T:79201;^0x369e8e0a^", "a heartbeat of the board", true},
    {"AIN24:24.18;AIN12:12.15;AIN5:5.12;AINDMH:12.16;DMHSTA:1;AINSTEER:1.00;DHB1A:4095,1;OSMC1:1,0;"
     "STEP1POS:-100;SERVO1POS:2000;PNum:7460;T:79340;^0x306eb6ac^",
     "damaged", false},
}};

void print(const std::string& text) { print_text(text + "\n"); }

bool decode_capture(bool json) {
  bool good = true;
  for (const Captured& each : captured) {
    Datagram datagram;
    const ReadResult result = read_datagram(Text(std::string_view(each.bytes)), datagram);
    const bool as_expected =
        static_cast<bool>(result) == each.good && (each.good || result.error == ReadError::crc);
    good = good && as_expected;
    if (json) continue;
    print(fmt::format("    {}", each.bytes));
    if (result) {
      print(fmt::format("      {} ({}), valid", each.meaning, to_text(kind_of(datagram))));
    } else {
      print(
          fmt::format("      {}: its bytes have the checksum {:#x}, but it contains {:#x}: dropped",
                      each.meaning, result.crc_expected, result.crc_found));
    }
    if (!as_expected) print("      THIS IS NOT AS EXPECTED");
  }
  return good;
}

class SeparateBoard {
 public:
  SeparateBoard(asio::io_context& io, const std::string& url)
      : child_(io, url, [this](const Json& event) { on_event(event); }) {
    const auto end = std::chrono::steady_clock::now() + Milliseconds(3000);
    while (host_url_.empty() && !ended_) {
      io.restart();
      if (io.run_one_until(end) == 0) break;
    }
    if (host_url_.empty()) {
      throw Error(ErrorKind::open, "r4 sim " + url, "does not listen",
                  "try this command in another terminal");
    }
  }

  const std::string& host_url() const { return host_url_; }
  const BoardLog& log() const { return log_; }

 private:
  void on_event(const Json& event) {
    const std::string type = event.value("type", "");
    if (type == "ended") ended_ = true;
    if (type == "listening") {
      host_url_ = event.value("host_url", "");
      if (host_url_.starts_with("udp:")) host_url_ += "?listen=0";  // port 2390 may be in use
    }
    if (type != "event") return;
    if (event.contains("silence")) log_.silence_ms = event["silence"].get<std::uint32_t>();
    if (event.contains("outputs")) log_.outputs_off = event["outputs"]["osmc"][0][0] == 0;
  }

  std::string host_url_;
  BoardLog log_;
  bool ended_ = false;
  ChildBoard child_;  // last member, because it calls on_event()
};

struct Stage {
  const char* name;
  const char* title;
  std::string board_url;  // where the other process listens; empty: none
};

// Only an interface with a virtual name, because other buses may have motors.
std::string virtual_can() {
  for (const CanInterface& each : list_can_interfaces()) {
    if (each.up && !each.has_controller && each.name.starts_with("vcan")) return each.name;
  }
  return {};
}

std::vector<Stage> stages(std::optional<Problem>& missing) {
  std::vector<Stage> all{
      {"in process", "Within this program (sim:)", ""},
      {"UDP", "Over UDP, as over WiFi: host and board are now two processes", "udp://127.0.0.1:0"},
      {"serial", "Over a serial line (a pseudo-terminal instead of USB): two processes", "pty:"},
  };
  const std::string interface = virtual_can();
  if (!interface.empty()) {
    all.push_back({"CAN", "Over a CAN bus (a virtual one): two processes",
                   fmt::format("can://{}?node={}", interface, can_nodes - 1)});
    return all;
  }
  try {
    CanSocket("vcan0", false).open();
  } catch (const Error& error) {
    missing = error.problem();
  }
  return all;
}

StoryResult play(const Stage& stage, const Story::Teller& teller) {
  asio::io_context io(1);
  StoryResult result;
  try {
    if (stage.board_url.empty()) {
      result = Story(io, "sim:", nullptr, teller).run();
    } else {
      SeparateBoard board(io, stage.board_url);
      result = Story(io, board.host_url(), &board.log(), teller).run();
    }
  } catch (const Error& error) {
    result.trouble = error.problem().text();
  }
  result.transport = stage.name;
  return result;
}

void print_json(const StoryResult& r) {
  print_line({{"type", "demo"},
              {"transport", r.transport},
              {"connect_ms", r.connect_ms},
              {"rate_hz", r.rate_hz},
              {"lost", r.lost},
              {"round_trip_us", r.round_trip_us},
              {"confirmed_ms", r.confirmed_ms},
              {"safe_ms", r.safe_ms},
              {"recovered_ms", r.recovered_ms},
              {"stop_ms", r.stop_ms},
              {"ok", r.good},
              {"trouble", r.trouble}});
}

void print_table(const std::vector<StoryResult>& results, const std::optional<Problem>& missing) {
  print("\nSummary");
  print(fmt::format("  {:<11}{:>9}{:>9}{:>7}{:>12}{:>11}{:>12}{:>11}{:>9}", "transport", "connect",
                    "states", "lost", "round trip", "command", "silence to", "recovery", "stop"));
  print(fmt::format("  {:<11}{:>9}{:>9}{:>7}{:>12}{:>11}{:>12}{:>11}{:>9}", "", "ms", "Hz", "",
                    "us", "ms", "safe, ms", "ms", "ms"));
  for (const StoryResult& r : results) {
    print(
        fmt::format("  {:<11}{:>9.1f}{:>9.1f}{:>7}{:>12.0f}{:>11.1f}{:>12.0f}{:>11.1f}{:>9.1f}  {}",
                    r.transport, r.connect_ms, r.rate_hz, r.lost, r.round_trip_us, r.confirmed_ms,
                    r.safe_ms, r.recovered_ms, r.stop_ms, r.good ? "ok" : "NOT OK"));
  }
  if (missing) {
    print(fmt::format("  {:<11}  not played: {}; {}", "CAN", missing->reason, missing->fix));
  }
  print(
      "  command: sent until seen in the board's state, which comes every 10 ms\n"
      "  silence to safe: at most 1000 ms + 20 ms; if the board is another process, its log has\n"
      "  the time");
}

int demo(const DemoOptions& options) {
  if (!options.json) print_text(introduction);
  bool good = decode_capture(options.json);
  std::vector<StoryResult> results;
  int chapter = 2;
  std::optional<Problem> missing;
  for (const Stage& stage : stages(missing)) {
    Story::Teller teller{[](std::string_view) {}, [](std::string_view) {}};
    if (!options.json) {
      print(fmt::format("\n{}. {}", chapter++, stage.title));
      teller.say = [](std::string_view text) { print(fmt::format("  {}", text)); };
      teller.show = [](std::string_view bytes) { print(fmt::format("              {}", bytes)); };
    }
    const StoryResult result = play(stage, teller);
    if (options.json) print_json(result);
    if (!options.json && !result.good) print("  NOT OK: " + result.trouble);
    good = good && result.good;
    results.push_back(result);
  }
  if (options.json && missing) {
    print_line({{"type", "not_played"},
                {"transport", "CAN"},
                {"reason", missing->reason},
                {"fix", missing->fix}});
  }
  if (!options.json) {
    print_table(results, missing);
    print(good ? "\nEvery step was true. Next: r4 --help"
               : "\nAt least one step was not true: see NOT OK above.");
  }
  return good ? 0 : static_cast<int>(ErrorKind::refused);
}

constexpr const char* demo_footer =
    R"(Starts simulated boards: one in this process, and two in their own processes, reached over UDP and
over a pseudo-terminal. Only this program is needed. If a virtual CAN interface (vcan0) is up,
another board is reached over it, as node 31. Its emergency stop reaches every simulated board on
that interface. The demo does not use other CAN interfaces, because motors may be connected to them.

Exit codes: 0 every step was true; 3 at least one step was not true.)";

}  // namespace

void add_demo(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<DemoOptions>();
  CLI::App* const command =
      add_subcommand(root, chosen, "demo", "Show what R4 is, over every transport, in ten seconds",
                     demo_footer, options, demo);
  add_json(*command, options->json, "print only the results, one object a transport");
}

}  // namespace r4::tool
