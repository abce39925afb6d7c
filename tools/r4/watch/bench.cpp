// SPDX-License-Identifier: GPL-3.0-or-later
// r4 bench: waits for control, then listens (2/5 of the time), asks (2/5) and commands (1/5).
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "../boards/board_set.hpp"
#include "../boards/paths.hpp"
#include "../shell/json.hpp"
#include "../shell/key_file.hpp"
#include "../shell/options.hpp"
#include "../shell/subcommands.hpp"
#include "r4link/async_board.hpp"
#include "r4link/discovery/url_pattern.hpp"
#include "r4link/error.hpp"
#include "r4link/link.hpp"

namespace r4::tool {
namespace {

using Clock = std::chrono::steady_clock;

constexpr Milliseconds connect_timeout{3000};
constexpr Milliseconds answer_timeout{1000};
// Pauses, because the board rejects packet numbers too far ahead (BoardLink::command_window).
constexpr std::size_t burst = 100;
constexpr Milliseconds pause{10};

struct BenchOptions {
  std::vector<std::string> urls;
  Milliseconds duration{5000};
  std::string key;
  bool json = false;
};

class Durations {
 public:
  void add(Time duration) { values_.push_back(static_cast<double>(duration.count())); }
  std::size_t count() const { return values_.size(); }
  double quantile(double share) {
    if (values_.empty()) return 0;
    const auto at = values_.begin() + std::lround(share * static_cast<double>(values_.size() - 1));
    std::nth_element(values_.begin(), at, values_.end());
    return *at;
  }

 private:
  std::vector<double> values_;
};

BoardOptions bench_board(const std::string& key) {
  BoardOptions options = with_key(key);
  options.session.arming = Arming::off;
  options.session.identify_interval = Milliseconds(0);  // only the bench sends questions
  return options;
}

class Bench {
 public:
  explicit Bench(const BenchOptions& options)
      : options_(options),
        board_(boards_.add(join_paths(options.urls), bench_board(options.key)).board),
        timer_(boards_.io()),
        pause_(boards_.io()) {}

  int run() {
    board_.open();
    connect();
    listen();
    ask();
    command();
    boards_.leave();
    if (options_.json) {
      print_json();
    } else {
      print_table();
    }
    return 0;
  }

 private:
  void run_for(Milliseconds time) {
    timer_.after(time, [this] { boards_.stop(); });
    boards_.io().restart();
    boards_.run();
  }

  void connect() {
    Subscription waiting = board_.on_state([this](const State&, const Datagram&) {
      if (board_.in_control()) boards_.stop();
    });
    const Clock::time_point start = Clock::now();
    run_for(connect_timeout);
    waiting.cancel();
    require_one_board(board_);
    if (!board_.in_control()) throw Error(explain(board_.name(), board_.link()));
    connect_us_ = std::chrono::duration<double, std::micro>(Clock::now() - start).count();
  }

  void listen() {
    const Statistics before = board_.statistics();
    const Milliseconds time = options_.duration * 2 / 5;
    const Clock::time_point start = Clock::now();
    run_for(time);
    const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
    const Statistics after = board_.statistics();
    states_ = after.states - before.states;
    lost_ = after.packets.lost - before.packets.lost;
    damaged_ = after.damaged - before.damaged;
    state_hz_ = static_cast<double>(states_) / seconds;
    jitter_us_ = after.jitter_us;
    if (states_ == 0) throw Error(explain(board_.name(), board_.link()));
  }

  void ask() {
    running_ = true;
    ask_next(burst);
    run_for(options_.duration * 2 / 5);
    running_ = false;
    pause_.cancel();
  }
  void ask_next(std::size_t left) {
    if (left == 0) {
      return pause_.after(pause, [this] { ask_next(burst); });
    }
    board_.async_send(Command::identify(), answer_timeout,
                      [this, left](const CommandResult& result) {
                        if (running_ && count(result, round_trips_, unanswered_))
                          ask_next(left - 1);
                      });
  }

  // Requests the fields that the session has already chosen, so the command changes nothing.
  void command() {
    running_ = true;
    command_next();
    run_for(options_.duration / 5);
    running_ = false;
  }
  void command_next() {
    board_.async_send(Command::fields(Text("DEFAULT")), answer_timeout,
                      [this](const CommandResult& result) {
                        if (running_ && count(result, confirmations_, unconfirmed_)) command_next();
                      });
  }

  // True if the command was confirmed or timed out. After another outcome, the next command would
  // have the same outcome.
  static bool count(const CommandResult& result, Durations& durations, std::uint64_t& failed) {
    if (result.outcome == Outcome::confirmed) {
      durations.add(result.elapsed);
    } else {
      ++failed;
    }
    return result.outcome == Outcome::confirmed || result.outcome == Outcome::timed_out;
  }

  double per_second() const {
    const double seconds = std::chrono::duration<double>(options_.duration / 5).count();
    return static_cast<double>(confirmations_.count()) / seconds;
  }

  void print_json() {
    const auto quantiles = [](Durations& durations) {
      return Json{{"count", durations.count()},
                  {"p50", durations.quantile(0.5)},
                  {"p90", durations.quantile(0.9)},
                  {"p99", durations.quantile(0.99)},
                  {"max", durations.quantile(1)}};
    };
    Json result{{"type", "bench"},
                {"transport", board_.name()},
                {"connect_us", connect_us_},
                {"round_trip_us", quantiles(round_trips_)},
                {"unanswered", unanswered_},
                {"state_hz", state_hz_},
                {"states", states_},
                {"lost", lost_},
                {"damaged", damaged_},
                {"jitter_us", jitter_us_},
                {"confirmation_us", quantiles(confirmations_)},
                {"unconfirmed", unconfirmed_},
                {"commands_per_s", per_second()}};
    Json transfers = transfers_json(board_.carrier_counters());
    if (!transfers.is_null()) result["transfers"] = std::move(transfers);
    print_line(result);
  }

  void print_table() {
    print_text(board_.name() + "\n");
    print_text("  in control after      {:>9.1f} ms\n", connect_us_ / 1000);
    print_text("  states                {:>9.1f} Hz    {} received, {} lost, {} damaged\n",
               state_hz_, states_, lost_, damaged_);
    print_text("  jitter                {:>9.0f} us\n", jitter_us_);
    const auto row = [](const char* what, Durations& durations, std::uint64_t failed) {
      print_text("  {:<21} {:>9.0f} us    p90 {:.0f}, p99 {:.0f}, max {:.0f}; {} of {} failed\n",
                 what, durations.quantile(0.5), durations.quantile(0.9), durations.quantile(0.99),
                 durations.quantile(1), failed, failed + durations.count());
    };
    row("round trip, median", round_trips_, unanswered_);
    row("command confirmed", confirmations_, unconfirmed_);
    print_text("  commands confirmed    {:>9.0f} a second, one at a time\n", per_second());
    print_transfers(board_.carrier_counters());
  }

  static void print_transfers(const CarrierCounters& counters) {
    if (!counters.transfers) return;
    const TransferCounters& transfers = *counters.transfers;
    print_text(
        "  transfers lost        {:>9}       {} wrong sequence, {} timed out, {} overflow, "
        "{} interrupted, {} cancelled\n",
        transfers.wrong_sequence + transfers.timed_out + transfers.overflow +
            transfers.interrupted + transfers.cancelled,
        transfers.wrong_sequence, transfers.timed_out, transfers.overflow, transfers.interrupted,
        transfers.cancelled);
    print_text(
        "  frames ignored        {:>9}       {} unexpected, {} malformed; dropped unread {}\n",
        transfers.unexpected + transfers.malformed, transfers.unexpected, transfers.malformed,
        counters.rx_overflows);
    print_text("  packed datagrams      {:>9}       {} malformed\n", transfers.packed,
               transfers.bad_form);
  }

  const BenchOptions& options_;
  BoardSet boards_;
  AsyncBoard& board_;
  Timer timer_;
  Timer pause_;
  double connect_us_ = 0;
  std::uint64_t states_ = 0;
  std::uint64_t lost_ = 0;
  std::uint64_t damaged_ = 0;
  double state_hz_ = 0;
  double jitter_us_ = 0;
  bool running_ = false;
  Durations round_trips_;
  std::uint64_t unanswered_ = 0;
  Durations confirmations_;
  std::uint64_t unconfirmed_ = 0;
};

int bench(const BenchOptions& options) { return Bench(options).run(); }

constexpr const char* bench_footer =
    R"(A round trip is the time from a question (Q:ID) to its answer; questions are sent one at a time. A
command is confirmed by the board's state, so at 100 Hz this takes up to 10 ms. The command does not
change anything.

Examples:
  r4 bench serial:auto
  r4 bench udp://127.0.0.1 --duration 10 --json

Exit codes: 0 done; 3 no board answers, or another host controls the board; 2 usage; 4, 5 the
transport cannot be opened.)";

}  // namespace

void add_bench(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<BenchOptions>();
  CLI::App* const command = add_subcommand(root, chosen, "bench", "Measure the link to a board",
                                           bench_footer, options, bench);
  add_paths(*command, options->urls);
  add_duration(*command, options->duration, "duration of the measurement (default 5)");
  add_key(*command, options->key);
  add_json(*command, options->json, "print JSON");
}

}  // namespace r4::tool
