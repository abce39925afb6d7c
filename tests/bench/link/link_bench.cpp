// SPDX-License-Identifier: GPL-3.0-or-later
// The link between two processes: round trip compared with a plain ping-pong, allocations, and
// streaming.
//
//     r4_link_bench [round-trips a path, default 20000 [part: round-trip, heap or stream]]
//
// The plain program and async_send take turns in blocks, so that other load of the machine affects
// both programs. If a limit is not met, the exit code is 1: asynchronous p50 at most 1.3 times the
// plain p50, each process on a separate core; no allocation per datagram; at 100 Hz at most 2 % of
// a core on either side.
#include <algorithm>
#include <asio/io_context.hpp>
#include <asio/post.hpp>
#include <asio/steady_timer.hpp>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "board_process.hpp"
#include "r4link/async_board.hpp"
#include "r4link/board.hpp"
#include "r4link/error.hpp"
#include "tests/bench/allocations.hpp"
#include "tests/support/at_will.hpp"
#include "transports/operation_slot.hpp"

namespace r4::bench {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr int block = 500;

bool all_met = true;

const char* verdict(bool met) {
  all_met = all_met && met;
  return met ? "met" : "MISSED";
}

struct Percentiles {
  double p50 = 0, p99 = 0;
};
Percentiles percentiles(std::vector<double>& seconds) {
  std::sort(seconds.begin(), seconds.end());
  return {seconds[seconds.size() / 2] * 1e6, seconds[seconds.size() * 99 / 100] * 1e6};
}

struct AsyncHost {
  explicit AsyncHost(const std::string& url) : board(io, url, test::at_will()) {
    board.open();
    run_until([this] { return board.in_control(); });
  }

  template <class Done>
  void run_until(Done done) {
    const auto deadline = Clock::now() + 10s;
    while (!done()) {
      io.run_one_for(1s);
      if (Clock::now() > deadline) {
        std::fprintf(stderr, "r4_link_bench: the board does not answer\n");
        std::exit(1);
      }
    }
  }
  void run_for(Clock::duration duration) {
    asio::steady_timer timer(io, duration);
    bool over = false;
    timer.async_wait([&](const std::error_code&) { over = true; });
    while (!over) io.run_one();
  }
  // Sends `count` commands one after another and appends the seconds that each command took.
  void round_trips(int count, std::vector<double>& seconds) {
    int left = count;
    Clock::time_point start;
    struct Ask {
      AsyncHost& host;
      std::vector<double>& seconds;
      int& left;
      Clock::time_point& start;
      void operator()(const CommandResult&) const {
        seconds.push_back(std::chrono::duration<double>(Clock::now() - start).count());
        if (--left > 0) {
          again();
        } else {
          host.io.stop();
        }
      }
      void again() const {
        start = Clock::now();
        host.board.async_send(Command::identify(), 1s, *this);
      }
    };
    Ask{*this, seconds, left, start}.again();
    io.run();
    io.restart();
  }

  // Only one thread uses this loop, so Asio needs no locks.
  asio::io_context io{ASIO_CONCURRENCY_HINT_UNSAFE};
  AsyncBoard board;
};

// --- round trip

void compare_round_trips(Transport path, int count, bool judged) {
  // Sizes of Q:ID and of the simulated board's answer, as sent. A line ends with CR LF.
  const std::size_t line_end = path == Transport::udp ? 0 : 2;
  EchoProcess plain(path, 42 + line_end, 55 + line_end);
  BoardProcess board_for_async(path, false);
  BoardProcess board_for_blocking(path, false);
  AsyncHost host(board_for_async.url());

  std::vector<double> raw, async, blocking;
  raw.reserve(static_cast<std::size_t>(count));
  async.reserve(static_cast<std::size_t>(count));
  blocking.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < block; ++i) plain.round_trip();
  for (int done = 0; done < count; done += block) {
    for (int i = 0; i < block; ++i) raw.push_back(plain.round_trip());
    host.round_trips(block, async);
  }
  host.board.close();
  {
    Board board(board_for_blocking.url(), test::at_will());
    board.wait_active();
    for (int i = 0; i < count; ++i) {
      const auto start = Clock::now();
      board.identify();
      blocking.push_back(std::chrono::duration<double>(Clock::now() - start).count());
    }
  }
  const Percentiles r = percentiles(raw);
  const Percentiles a = percentiles(async);
  const Percentiles b = percentiles(blocking);
  std::printf("%s  plain ping-pong   p50 %6.1f us   p99 %6.1f us\n", to_text(path), r.p50, r.p99);
  std::printf("%s  async_send        p50 %6.1f us   p99 %6.1f us   %.2f times%s%s\n", to_text(path),
              a.p50, a.p99, a.p50 / r.p50, judged ? ", bar 1.30: " : "",
              judged ? verdict(a.p50 <= 1.3 * r.p50) : "");
  std::printf("%s  Board::identify   p50 %6.1f us   p99 %6.1f us   %.2f times\n", to_text(path),
              b.p50, b.p99, b.p50 / r.p50);
}

// --- allocations

void print_allocations(Transport path, const char* what, std::uint64_t host, std::uint64_t board,
                       std::uint64_t datagrams) {
  std::printf("%s  %-34s %6llu datagrams   host %llu, board %llu allocations, bar 0: %s\n",
              to_text(path), what, static_cast<unsigned long long>(datagrams),
              static_cast<unsigned long long>(host), static_cast<unsigned long long>(board),
              verdict(host == 0 && board == 0));
}

void count_allocations(Transport path) {
  BoardProcess process(path, false);
  {
    AsyncHost host(process.url());
    std::vector<double> seconds;
    seconds.reserve(10000);
    std::uint64_t states = 0;
    host.board.on_state([&](const State&, const Datagram&) { ++states; });
    host.round_trips(500, seconds);
    host.run_for(1200ms);  // one-time setup is finished after this

    // Starts and ends on the loop, so that the allocations of this function are not counted.
    struct Count {
      AsyncHost& host;
      std::uint64_t before = 0, made = 0;
      int left = 0;
      void end() {
        made = allocations() - before;
        host.io.stop();
      }
    } count{host};
    const auto run_counted = [&](auto start) {
      asio::post(host.io, [&] {
        count.before = allocations();
        start();
      });
      host.io.run();
      host.io.restart();
    };
    // The first call includes one-time setup.
    const auto measure = [&](const char* what, auto start) {
      run_counted(start);
      const Usage board_before = process.usage();
      const Statistics then = host.board.statistics();
      run_counted(start);
      const Statistics now = host.board.statistics();
      const Usage board_after = process.usage();
      print_allocations(path, what, count.made, board_after.allocations - board_before.allocations,
                        now.received - then.received + now.heartbeats - then.heartbeats +
                            now.commands - then.commands);
    };

    struct Post {
      Count& count;
      void operator()() const {
        if (count.left-- == 0) return count.end();
        count.host.board.post(Command::osmc(1, Pwm(count.left), Direction::forward));
        asio::post(count.host.io, *this);
      }
    };
    struct Identify {
      Count& count;
      void operator()(const CommandResult&) const { ask(); }
      void ask() const {
        if (count.left-- == 0) return count.end();
        count.host.board.async_send(Command::identify(), 1s, *this);
      }
    };
    struct Send {
      Count& count;
      void operator()(const CommandResult&) const { send(); }
      void send() const {
        if (count.left-- == 0) return count.end();
        count.host.board.async_send(Command::osmc(1, Pwm(count.left), Direction::forward), 1s,
                                    *this);
      }
    };
    asio::steady_timer timer(host.io);
    OperationSlot end_slot;
    measure("states and heartbeats, 2 s", [&] {
      timer.expires_after(2s);
      timer.async_wait(end_slot.handler([&] { count.end(); }));
    });
    measure("post(), 1000 setpoints", [&] {
      count.left = 1000;
      Post{count}();
    });
    measure("async_send of Q:ID, 1000", [&] {
      count.left = 1000;
      Identify{count}.ask();
    });
    measure("async_send, 100 confirmed", [&] {
      count.left = 100;
      Send{count}.send();
    });
  }
  BoardProcess other(path, false);
  Board board(other.url(), test::at_will());
  board.wait_active();
  for (int i = 0; i < 300; ++i) {  // until the deques of the loop have their final size
    board.post(Command::osmc(1, Pwm(i), Direction::forward));
    if (i % 10 == 0) board.next_state();
  }
  const Usage board_before = other.usage();
  const std::uint64_t before = allocations();
  for (int i = 0; i < 1000; ++i) {
    board.post(Command::osmc(1, Pwm(i), Direction::forward));
    if (i % 10 == 0) board.next_state();
  }
  const std::uint64_t made = allocations() - before;
  print_allocations(path, "Board::post() and next_state()", made,
                    other.usage().allocations - board_before.allocations, 1100);
}

// --- streaming

void stream(Transport path, int rate_hz) {
  const bool unbound = rate_hz == 0;
  BoardProcess process(path, unbound);
  AsyncHost host(process.url());
  if (!unbound) {
    bool set = false;
    const std::string rate = std::to_string(rate_hz);
    host.board.async_send(Command::setting("rate", rate), 1s,
                          [&](const CommandResult& r) { set = r.outcome == Outcome::confirmed; });
    host.run_until([&] { return set; });
  }
  host.run_for(200ms);
  const Usage board_before = process.usage();
  const Usage host_before = own_usage();
  const Statistics before = host.board.statistics();
  const auto start = Clock::now();
  host.run_for(2s);
  const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
  const Statistics after = host.board.statistics();
  const Usage host_after = own_usage();
  const Usage board_after = process.usage();

  const auto received = static_cast<double>(after.received - before.received);
  const auto sent = static_cast<double>(board_after.sent - board_before.sent);
  const double host_cpu = host_after.cpu_s - host_before.cpu_s;
  const double board_cpu = board_after.cpu_s - board_before.cpu_s;
  char wanted[16] = "   max";
  if (!unbound) std::snprintf(wanted, sizeof wanted, "%6d", rate_hz);
  std::printf(
      "%s  %s Hz   sent %8.0f/s   received %8.0f/s   CPU a datagram: board %5.2f us, "
      "host %5.2f us   of a core: board %5.2f %%, host %5.2f %%",
      to_text(path), wanted, sent / seconds, received / seconds, board_cpu / sent * 1e6,
      host_cpu / received * 1e6, board_cpu / seconds * 100, host_cpu / seconds * 100);
  if (rate_hz == 100) {
    const bool met = board_cpu <= 0.02 * seconds && host_cpu <= 0.02 * seconds;
    std::printf(", bar 2 %%: %s", verdict(met));
  }
  std::printf("\n");
}

int run(int count, const std::string& part) {
  const auto wanted = [&](const char* name) { return part.empty() || part == name; };
  if (wanted("round-trip")) {
    std::printf("round trip, %d questions in blocks of %d, 42 bytes there and 55 back\n", count,
                block);
    for (const Placement placement : {Placement::two_cores, Placement::one_core}) {
      place(placement);
      std::printf("  %s\n", to_text(placement));
      for (const Transport path : {Transport::udp, Transport::pty}) {
        compare_round_trips(path, count, placement == Placement::two_cores);
      }
    }
    place(Placement::two_cores);
  }
  if (wanted("heap")) {
    std::printf("\nallocations in the steady state\n");
    for (const Transport path : {Transport::udp, Transport::pty}) count_allocations(path);
  }
  if (wanted("stream")) {
    std::printf("\nstreaming, 2 s each\n");
    for (const Transport path : {Transport::udp, Transport::pty}) {
      for (const int rate : {100, 1000, 0}) stream(path, rate);
    }
  }
  return all_met ? 0 : 1;
}

}  // namespace
}  // namespace r4::bench

int main(int argc, char** argv) {
  const int count = argc > 1 ? std::atoi(argv[1]) : 20000;
  try {
    return r4::bench::run(std::max(count, r4::bench::block), argc > 2 ? argv[2] : "");
  } catch (const r4::Error& error) {
    std::fprintf(stderr, "r4_link_bench: %s\n", error.what());
    return 1;
  }
}
