// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <asio/io_context.hpp>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "../boards/run_end.hpp"
#include "../shell/json.hpp"
#include "../shell/options.hpp"
#include "../shell/subcommands.hpp"
#include "host/replay/replay_records.hpp"
#include "host/standard_registry.hpp"
#include "input_lines.hpp"
#include "protocol/datagram/numbers.hpp"
#include "sim_log.hpp"
#include "transports/board_end.hpp"
#include "transports/registry.hpp"

namespace r4::tool {
namespace {

using Clock = std::chrono::steady_clock;

struct ReplayOptions {
  std::string file;
  std::string url = "udp://127.0.0.1:2018";
  std::uint64_t path = 1;
  double speed = 1;
  ReplayStart start;
  std::optional<Milliseconds> duration;
  bool step = false;
  bool json = false;
};

// Records or file pieces handled before other work of the loop runs.
constexpr int steps_in_a_turn = 32;
// Limits of the audience: a peer silent for this time is removed.
constexpr std::chrono::seconds audience_for{2};
constexpr std::size_t most_peers = 8;

// Sends the recorded datagrams to each peer that has sent something. Commands have no effect.
class Replay : private Carrier::Handler {
 public:
  explicit Replay(const ReplayOptions& options)
      : options_(options),
        records_(options.file, options.file, static_cast<std::uint16_t>(options.path),
                 options.start),
        carrier_(standard_registry().make(io_, options.url, Role::board)),
        timer_(io_),
        run_end_(io_),
        first_(records_.next()->time) {}
  ~Replay() { carrier_->close(); }

  int run() {
    run_end_.watch(options_.duration);
    carrier_->open(*this);
    {
      SimOutput output(options_.json);
      output.listening({carrier_->name()});
    }
    std::optional<InputLines> lines;
    if (options_.step) {
      lines.emplace(
          io_, [this](const std::string&) { step(); }, [this](const Problem*) { io_.stop(); });
    } else {
      wait();
    }
    began_ = Clock::now();
    io_.run();
    if (!options_.json) {
      print_text("{}: {} datagrams\n", printable(options_.file), sent_);
    }
    return damaged_ ? static_cast<int>(ErrorKind::data) : 0;
  }

 private:
  void on_datagram(std::string_view, Peer from) override {
    if (from == everyone || (!audience_.contains(from) && audience_.size() == most_peers)) return;
    audience_[from] = Clock::now();
  }
  void on_carrier_event(const CarrierEvent& event) override {
    // The absence of listeners is not reported.
    if (event.kind == CarrierEvent::Kind::warning) print_trouble("r4: " + event.problem.text());
  }

  Clock::time_point due() const {
    const ReplayRecords::Item* const next = records_.next();
    if (next == nullptr) return began_;
    const std::chrono::duration<double, std::micro> later = (next->time - first_) / options_.speed;
    return began_ + std::chrono::duration_cast<Clock::duration>(later);
  }

  void wait() {
    timer_.at(due(), [this] {
      for (int i = 0; i < steps_in_a_turn && !io_.stopped(); ++i) {
        if (records_.next() == nullptr) {
          if (!read_on()) return io_.stop();
        } else if (due() > Clock::now()) {
          break;
        } else {
          play(records_.take());
        }
      }
      wait();
    });
  }

  void step() {
    while (records_.next() != nullptr || read_on()) {
      if (records_.next() == nullptr) continue;
      const ReplayRecords::Item item = records_.take();
      play(item);
      if (item.kind != RecordKind::from_board) continue;
      const std::chrono::duration<double> at = item.time - first_;
      print_text("{:.6f} {}\n", at.count(), escaped(item.bytes));
      return;
    }
    io_.stop();
  }

  bool read_on() {
    try {
      return records_.read_on();
    } catch (const Error& error) {
      return tell_damage(error.problem().text()), false;
    }
  }

  void play(const ReplayRecords::Item& item) {
    if (item.kind != RecordKind::from_board) {
      constexpr std::string_view damage = "warning line ";
      if (item.bytes.starts_with(damage)) tell_damage(options_.file + ": " + item.bytes.substr(8));
      return;
    }
    ++sent_;
    const Clock::time_point now = Clock::now();
    std::erase_if(audience_, [&](const auto& peer) { return now - peer.second > audience_for; });
    carrier_->send(item.bytes, Priority::normal, everyone);
    const BoardEnd& end = board_end_of(*carrier_);
    for (const auto& [peer, heard] : audience_) {
      if (!end.reaches(peer)) carrier_->send(item.bytes, Priority::normal, peer);
    }
  }

  void tell_damage(const std::string& words) {
    damaged_ = true;
    print_trouble("r4: " + words);
  }

  const ReplayOptions& options_;
  asio::io_context io_{1};
  ReplayRecords records_;
  const std::unique_ptr<Carrier> carrier_;
  Timer timer_;
  RunEnd run_end_;
  const Time first_;
  Clock::time_point began_;
  std::map<Peer, Clock::time_point> audience_;
  std::uint64_t sent_ = 0;
  bool damaged_ = false;
};

int replay(const ReplayOptions& options) { return Replay(options).run(); }

double read_speed(const std::string& text) {
  std::int32_t hundredths = 0;
  if (parse_hundredths(Text(text), hundredths) && hundredths > 0) return hundredths / 100.0;
  throw Error(ErrorKind::usage, "--speed " + text, "is not a valid speed",
              "write a number such as 0.5 or 10");
}

constexpr const char* replay_footer =
    R"(Sends the recorded datagrams of a board again, at the recorded speed, on a transport where hosts
find it. Hosts receive the recorded states, heartbeats and answers, including damaged datagrams. A
replayed board does not obey commands or answer questions: commands are not confirmed, and a stop
has no effect. Over UDP it sends to each program that sent to it in the last two seconds, eight
programs at most; on a pty and a CAN bus it sends to all. If the recorded transport was down, it is
silent for the same time; its present transport stays open.

For a program on this computer, replay:FILE is simpler: r4 monitor replay:drive.r4log

With --step, each line on standard input sends one datagram, and prints it.

Examples:
  r4 replay drive.r4log                         at udp://127.0.0.1:2018
  r4 replay drive.r4log.zst pty:/tmp/r4 --from 12 --speed 0.5
  r4 replay drive.r4log --from 2026-11-23T21:20:00
  r4 replay robots.r4log 'can://vcan0?node=3' --path 2
  r4 replay drive.r4log --step                  press Return

Exit codes: 0 the recording has ended, or --duration or Ctrl-C; 1 some parts could not be read, or
the file is not a recording; 2 usage; 4, 5 the file or the transport cannot be opened.)";

}  // namespace

void add_replay(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<ReplayOptions>();
  CLI::App* const command = add_subcommand(root, chosen, "replay", "Play a recording as a board",
                                           replay_footer, options, replay);
  add_text(*command, "FILE", options->file, "a recording", file_type, Need::required);
  add_text(*command, "URL", options->url, "URL where it listens (default udp://127.0.0.1:2018)",
           url_type);
  add_number(*command, "--path", options->path, 1, 65535,
             "number of the board in r4 info (default 1)");
  add_text(
      *command, "--speed",
      [options](const std::string& text) { options->speed = read_speed(text); },
      "speed relative to the recording (default 1)", "TIMES", Need::optional);
  add_text(
      *command, "--from",
      [options](const std::string& text) { options->start = ReplayStart::of("--from", text); },
      "start of the replay: seconds to skip, or a time in UTC", "TIME", Need::optional);
  add_duration(*command, options->duration);
  add_flag(*command, "--step", options->step, "send one datagram for each line on standard input");
  add_json(*command, options->json, "print its URL as JSON");
}

}  // namespace r4::tool
