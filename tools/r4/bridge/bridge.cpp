// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/bridge.hpp"

#include <fmt/format.h>

#include <array>
#include <asio/io_context.hpp>
#include <asio/post.hpp>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "../boards/run_end.hpp"
#include "../shell/json.hpp"
#include "../shell/key_file.hpp"
#include "../shell/options.hpp"
#include "../shell/subcommands.hpp"

namespace r4::tool {
namespace {

struct Options {
  std::string hosts;
  std::string board;
  bool json = false;
  Milliseconds every{10'000};
  Milliseconds timeout{1000};
  std::optional<Milliseconds> duration;
  std::vector<std::string> keys;
  bool open = false;
};

struct NamedCounter {
  const char* name;
  std::uint64_t BridgeCounters::*value;
};
constexpr std::array<NamedCounter, 9> named_counters{{
    {"passed", &BridgeCounters::passed},
    {"stops", &BridgeCounters::stops},
    {"damaged", &BridgeCounters::damaged},
    {"misdirected", &BridgeCounters::misdirected},
    {"kept_out", &BridgeCounters::kept_out},
    {"refused", &BridgeCounters::refused},
    {"late", &BridgeCounters::late},
    {"undelivered", &BridgeCounters::undelivered},
    {"outdated", &BridgeCounters::outdated},
}};

const char* to_text(BridgeSide side) { return side == BridgeSide::hosts ? "hosts" : "board"; }

// Prints outside the thread of the bridge, so that the bridge never waits for a reader.
class Report {
 public:
  explicit Report(bool json) : json_(json) {}

  void joined(const std::vector<BridgeStatus>& all) {
    told_.resize(all.size());
    for (const BridgeStatus& each : all) {
      if (json_) {
        lines_.write(
            line_of({{"type", "bridge"}, {"hosts", each.hosts.name}, {"board", each.board.name}}));
      } else {
        lines_.write(fmt::format("{} <-> {}\n", each.hosts.name, each.board.name));
      }
    }
  }

  void event(const BridgeEvent& event) {
    const Problem& problem = event.event.problem;
    const char* const kind = r4::to_text(event.event.kind);
    if (json_) {
      Json line = problem_json(problem);
      line["type"] = "transport";
      line["event"] = kind;
      line["side"] = to_text(event.side);
      lines_.write(line_of(line));
    } else if (event.event.kind == CarrierEvent::Kind::up) {
      print_trouble(problem.thing + ": up");
    } else {
      print_trouble("{} ({})", problem.text(), kind);
    }
  }

  void counters(const std::vector<BridgeStatus>& all) {
    for (std::size_t i = 0; i < all.size(); ++i) {
      tell_counters(BridgeSide::hosts, all[i].hosts, told_[i].hosts);
      tell_counters(BridgeSide::board, all[i].board, told_[i].board);
    }
  }

  void end() const {
    const std::uint64_t lost = lines_.lost();
    if (lost == 0) return;
    print_trouble("r4: {} lines were dropped, because the reader of the output is too slow", lost);
  }

 private:
  void tell_counters(BridgeSide side, const BridgeEnd& now, BridgeEnd& told) {
    bool changed = told.name.empty();
    for (const NamedCounter& each : named_counters) {
      changed = changed || now.from.*each.value != told.from.*each.value;
    }
    if (!changed) return;
    told = now;
    if (json_) {
      Json line{
          {"type", "counters"}, {"side", to_text(side)}, {"transport", now.name}, {"up", now.up}};
      for (const NamedCounter& each : named_counters) line[each.name] = now.from.*each.value;
      return lines_.write(line_of(line));
    }
    std::string text;
    for (const NamedCounter& each : named_counters) {
      const bool told_always = each.value == &BridgeCounters::passed;
      if (now.from.*each.value == 0 && !told_always) continue;
      std::string name = each.name;
      if (name == "kept_out") name = "kept out";
      text += fmt::format("{}{} {}", text.empty() ? "" : ", ", now.from.*each.value, name);
    }
    print_trouble("from {}: {}", now.name, text);
  }

  const bool json_;
  LineWriter lines_{std::size_t{1} << 16};
  std::vector<BridgeStatus> told_;
};

int bridge(const Options& options) {
  asio::io_context io(1);
  Report report(options.json);
  BridgeOptions bridge_options;
  bridge_options.timeout = options.timeout;
  for (const std::string& path : options.keys) bridge_options.keys.push_back(load_key(path));
  bridge_options.open = options.open;
  bridge_options.on_event = [&](const BridgeEvent& event) {
    asio::post(io, [&report, event] { report.event(event); });
  };
  Bridge bridge(options.hosts, options.board, std::move(bridge_options));
  RunEnd run_end(io);
  run_end.watch(options.duration);
  report.joined(bridge.status());

  Timer timer(io);
  timer.every(options.every, [&] { report.counters(bridge.status()); });
  io.run();
  bridge.close();
  io.restart();
  io.poll();  // handles the last events
  report.counters(bridge.status());
  report.end();
  return 0;
}

constexpr const char* footer =
    R"(The first URL is where hosts connect, as for r4 sim; the second URL is the board's, as for r4 send. So any
tool that speaks UDP can drive a board on USB or CAN (docs/how-to/bridge.md). Datagrams pass unchanged. The
bridge sends nothing for a silent host: a board behind a bridge goes safe like any other board.

The bridge serves up to 16 hosts, and the board decides which host controls it. Hosts without a session id
(as in the paper) pass one at a time: the next host passes after the first host has been silent for
--timeout. A stop from any host passes first. A datagram that has waited for 0.1 s is dropped. If the board
is absent, the bridge waits for the board.

A board obeys commands from its own cable without a key. So if a board at a serial port has a key, the
bridge passes only signed datagrams. The bridge needs the key to check them: --key FILE. Without --key, a
bridge to a serial port accepts only hosts on this computer; with --open, every host that reaches the bridge
may drive the board. Settings that need a cable (C:key, C:network, C:password and others) never pass.

The bridge reports on standard error when a transport connects or disconnects. Every ten seconds, and at the
end, it reports changed counters: the datagrams from each side that it passed, or dropped and why. With
--json it reports on standard output, one object a line:
  {"type":"bridge","hosts":…,"board":…}                             for each board, at the start
  {"type":"transport","event":"up|down|warning","side":"hosts|board","thing":…,"reason":…,"fix":…}
  {"type":"counters","side":…,"transport":…,"up":…,"passed":…,"stops":…,"damaged":…,"misdirected":…,
   "kept_out":…,"refused":…,"late":…,"undelivered":…,"outdated":…}

Examples:
  r4 bridge udp:// serial:auto                        for programs of this computer
  r4 bridge udp://0.0.0.0:2018 'can://can0?node=3'    for the network: any host there may drive the board
  r4 bridge udp://0.0.0.0:2018 serial:auto --key /etc/r4link/key    for hosts that have the key
  r4 bridge udp://0.0.0.0:2100-2107 'can://can0?node=0-7'
  r4 bridge pty:/tmp/r4 udp://192.168.0.125           a serial port for a board on WiFi

Exit codes: 0 ended by --duration or a signal; 2 usage; 4 a port cannot be opened; 5 permission denied.)";

}  // namespace

void add_bridge(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<Options>();
  CLI::App* const command = add_subcommand(
      root, chosen, "bridge", "Carry datagrams between hosts and a board", footer, options, bridge);
  add_text(*command, "HOSTS", options->hosts,
           "the URL to which hosts connect, such as udp://0.0.0.0:2018", url_type, Need::required);
  add_text(*command, "BOARD", options->board, "the board, such as can://can0?node=3", url_type,
           Need::required);
  add_json(*command, options->json, "print events and counters as JSON, one object a line");
  add_seconds(*command, "--every", options->every,
              "how often to report changed counters (default 10)");
  add_seconds(*command, "--timeout", options->timeout,
              "silence before another host is served: the board's timeout (default 1)");
  add_duration(*command, options->duration);
  add_keys(*command, options->keys);
  add_flag(*command, "--open", options->open,
           "let every host at HOSTS drive a board at a serial port without its key");
}

}  // namespace r4::tool
