// SPDX-License-Identifier: GPL-3.0-or-later
// The cost of a fleet, for several numbers of boards. The boards are simulated in a separate
// process and send states over UDP at 100 Hz each. r4::Fleet runs on one core.
//
//     r4_fleet_bench [boards, default 1, 10, 100 and 1000] [seconds, default 5]
//     r4_fleet_bench INTERFACE [seconds]
//
// The second form compares a fleet of eight boards on a CAN bus, which has one socket, with eight
// Boards, which have one socket each. The boards send states at 1000 Hz, or as fast as the bus
// allows.
//
// If a limit is not met, the exit code is 1. With a thousand boards: no datagram is lost. A
// datagram costs the host no heap, and at most 1.25 times the time of a datagram of one board that
// sends as fast as possible. A board costs the host at most 24 kB. A simulated board costs at most
// 64 kB, and 6 us a state. The host notices the silence of one board at most 20 ms later than with
// one board.
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <asio/io_context.hpp>
#include <asio/posix/stream_descriptor.hpp>
#include <asio/steady_timer.hpp>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "../link/board_process.hpp"
#include "firmware/ports/sim/simulated_board.hpp"
#include "r4link/async_board.hpp"
#include "r4link/board.hpp"
#include "r4link/error.hpp"
#include "r4link/fleet.hpp"
#include "tests/bench/allocations.hpp"
#include "tests/support/at_will.hpp"
#include "transports/registry.hpp"

namespace r4::bench {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

bool all_met = true;

const char* verdict(bool met) {
  all_met = all_met && met;
  return met ? "met" : "MISSED";
}

double resident_kb() {
  std::FILE* const file = std::fopen("/proc/self/statm", "r");
  require(file != nullptr, "/proc/self/statm");
  long all = 0;
  long resident = 0;
  require(std::fscanf(file, "%ld %ld", &all, &resident) == 2, "/proc/self/statm");
  std::fclose(file);
  return static_cast<double>(resident) * static_cast<double>(::sysconf(_SC_PAGESIZE)) / 1024;
}

void allow_files(std::size_t boards) {
  rlimit limit{};
  ::getrlimit(RLIMIT_NOFILE, &limit);
  limit.rlim_cur = std::min<rlim_t>(boards * 4 + 64, limit.rlim_max);
  ::setrlimit(RLIMIT_NOFILE, &limit);
}

struct BoardsUsage {
  double cpu_s = 0;
  std::uint64_t sent = 0;
  double kb_a_board = 0;
  Clock::time_point now{};  // CLOCK_MONOTONIC, which host and boards share
};

// Boards in one process, on one loop.
class BoardsProcess : public ChildProcess {
 public:
  BoardsProcess(const std::vector<std::string>& urls, std::uint16_t rate_hz) : ports_(urls.size()) {
    if (fork_child()) serve(urls, rate_hz);
    read_all(control_, ports_.data(), ports_.size() * sizeof ports_[0]);
  }
  explicit BoardsProcess(std::size_t count)
      : BoardsProcess(std::vector<std::string>(count, "udp://127.0.0.1:0"), 100) {}
  std::vector<std::string> urls() const {
    std::vector<std::string> urls;
    for (const std::uint16_t port : ports_) {
      urls.push_back("udp://127.0.0.1:" + std::to_string(port) + "?listen=0");
    }
    return urls;
  }
  BoardsUsage usage() const { return ask('u'); }
  // Makes the first board silent, and returns the time.
  Clock::time_point silence() const { return ask('s').now; }

 private:
  BoardsUsage ask(char question) const {
    write_all(control_, &question, 1);
    BoardsUsage usage;
    read_all(control_, &usage, sizeof usage);
    return usage;
  }

  [[noreturn]] void serve(const std::vector<std::string>& urls, std::uint16_t rate_hz) {
    allow_files(urls.size());
    const double before_kb = resident_kb();
    asio::io_context io{1};
    std::vector<std::unique_ptr<sim::SimulatedBoard>> boards;
    std::vector<const Carrier*> ends;
    for (std::size_t i = 0; i < urls.size(); ++i) {
      sim::SimulatedBoard::Options options;
      options.board_id = "sim-" + std::to_string(i);
      options.settings.state_rate_hz = rate_hz;
      boards.push_back(std::make_unique<sim::SimulatedBoard>(io, std::move(options)));
      auto carrier = Registry::standard().make(io, urls[i], Role::board);
      ends.push_back(carrier.get());
      boards.back()->add_carrier(std::move(carrier));
      boards.back()->start();
      const std::string& name = ends.back()->name();
      if (!name.starts_with("udp:")) continue;
      ports_[i] = static_cast<std::uint16_t>(std::stoi(name.substr(name.rfind(':') + 1)));
    }
    write_all(control_, ports_.data(), ports_.size() * sizeof ports_[0]);

    asio::posix::stream_descriptor control(io, control_);
    char question = 0;
    const std::function<void()> listen = [&] {
      control.async_read_some(
          asio::buffer(&question, 1), [&](const std::error_code& error, std::size_t) {
            if (error) end_child();
            if (question == 's') boards.front()->stop();
            BoardsUsage usage;
            usage.now = Clock::now();
            usage.cpu_s = own_usage().cpu_s;
            usage.kb_a_board = (resident_kb() - before_kb) / static_cast<double>(boards.size());
            for (const Carrier* const end : ends) usage.sent += end->counters().tx_datagrams;
            write_all(control_, &usage, sizeof usage);
            listen();
          });
    };
    listen();
    io.run();
    end_child();
  }

  std::vector<std::uint16_t> ports_;
};

// Microseconds per datagram of one board that sends as fast as possible.
double alone_us() {
  BoardProcess process(Transport::udp, true);
  asio::io_context io{ASIO_CONCURRENCY_HINT_UNSAFE};
  AsyncBoard board(io, process.url(), test::at_will());
  board.open();
  io.run_for(500ms);
  const double cpu_s = own_usage().cpu_s;
  const std::uint64_t received = board.statistics().received;
  io.run_for(2s);
  const auto datagrams = static_cast<double>(board.statistics().received - received);
  return (own_usage().cpu_s - cpu_s) / datagrams * 1e6;
}

struct Sums {
  std::uint64_t received = 0;
  std::uint64_t lost = 0;
  std::size_t well = 0;
};
Sums sums_of(const Fleet& fleet) {
  Sums sums;
  for (const BoardHealth& each : fleet.health()) {
    sums.received += each.statistics.received;
    sums.lost += each.statistics.packets.lost;
    sums.well += each.well() ? 1 : 0;
  }
  return sums;
}

// Milliseconds from the silence of the first board until the host reports it.
double time_to_notice_ms(Fleet& fleet, const BoardsProcess& process) {
  while (fleet.next_event()) {
  }
  const Clock::time_point silent = process.silence();
  const auto deadline = Clock::now() + 5s;
  while (Clock::now() < deadline) {
    const std::optional<FleetEvent> event = fleet.next_event(1s);
    if (event && event->kind == FleetEvent::Kind::link && !is_heard(event->link.state)) {
      if (event->board != 0) return -1;  // another board
      return std::chrono::duration<double, std::milli>(Clock::now() - silent).count();
    }
  }
  return -1;
}

void measure(std::size_t count, std::chrono::seconds seconds, double reference_us) {
  BoardsProcess process(count);
  const double before_kb = resident_kb();
  Fleet fleet(process.urls(), test::at_will());
  if (const auto missing = fleet.wait_active(20s); !missing.empty()) {
    std::fprintf(stderr, "r4_fleet_bench: %zu of %zu boards do not answer\n", missing.size(),
                 count);
    std::exit(1);
  }
  std::this_thread::sleep_for(2s);  // one-time setup is finished after this
  const Sums before = sums_of(fleet);
  const BoardsUsage boards_before = process.usage();
  const double cpu_before = own_usage().cpu_s;
  const std::uint64_t heap_before = allocations();
  std::this_thread::sleep_for(seconds);
  const std::uint64_t heap = allocations() - heap_before;
  const double cpu_s = own_usage().cpu_s - cpu_before;
  const BoardsUsage boards_after = process.usage();
  const Sums after = sums_of(fleet);
  const double host_kb = (resident_kb() - before_kb) / static_cast<double>(count);

  const auto received = static_cast<double>(after.received - before.received);
  const auto sent = static_cast<double>(boards_after.sent - boards_before.sent);
  const double host_us = cpu_s / received * 1e6;
  const double board_us = (boards_after.cpu_s - boards_before.cpu_s) / sent * 1e6;
  const std::uint64_t lost = after.lost - before.lost;
  const auto length = static_cast<double>(seconds.count());

  // The time until the last post is sent, and the time from a stop until the last board has
  // confirmed it.
  const auto posting = Clock::now();
  std::vector<BoardSetpoints> setpoints;
  for (std::size_t i = 0; i < count; ++i) {
    setpoints.push_back({i, Setpoints{Command::osmc(1, Pwm(500), Direction::forward)}});
  }
  fleet.post(setpoints);
  const double post_ms = std::chrono::duration<double, std::milli>(Clock::now() - posting).count();
  const auto stopping = Clock::now();
  const bool stopped = fleet.stop(2s).all_confirmed();
  const double stop_ms = std::chrono::duration<double, std::milli>(Clock::now() - stopping).count();
  const double notice_ms = time_to_notice_ms(fleet, process);

  std::printf("%6zu %9.0f %6llu %8.2f %6.2f %8.1f %8.1f %8.2f %8.1f %9.2f %8.1f%s %8.0f\n", count,
              received / length, static_cast<unsigned long long>(lost), host_us,
              host_us / reference_us, cpu_s / length * 100, host_kb, board_us,
              boards_after.kb_a_board, post_ms, stop_ms, stopped ? "" : "!", notice_ms);
  if (heap != 0) std::printf("       %llu allocations\n", static_cast<unsigned long long>(heap));
  static const double alone_ms = notice_ms;
  if (count < 1000) return;
  std::printf(
      "none lost: %s; 1.25 times: %s; 24 kB: %s; no heap: %s; simulated boards 6 us: %s, 64 kB: "
      "%s; "
      "silence within 20 ms of alone: %s\n",
      verdict(lost == 0), verdict(host_us <= 1.25 * reference_us), verdict(host_kb <= 24),
      verdict(heap < 100), verdict(board_us <= 6), verdict(boards_after.kb_a_board <= 64),
      verdict(notice_ms > 0 && notice_ms <= alone_ms + 20));
}

// --- eight boards on a CAN bus

struct Counts {
  std::uint64_t received = 0, lost = 0;
};

// Prints the datagrams of `counts()` and the processor time during `seconds`.
void measure_bus(const char* what, const BoardsProcess& boards, std::chrono::seconds seconds,
                 const std::function<Counts()>& counts) {
  std::this_thread::sleep_for(1s);
  const Counts before = counts();
  const std::uint64_t sent_before = boards.usage().sent;
  const double cpu_before = own_usage().cpu_s;
  std::this_thread::sleep_for(seconds);
  const double cpu_s = own_usage().cpu_s - cpu_before;
  const Counts after = counts();
  const std::uint64_t sent = boards.usage().sent - sent_before;
  const auto received = static_cast<double>(after.received - before.received);
  // A datagram that is counted as lost may arrive late.
  std::printf("%-22s %9.0f %9.0f %8lld %10.2f\n", what,
              static_cast<double>(sent) / static_cast<double>(seconds.count()),
              received / static_cast<double>(seconds.count()),
              static_cast<long long>(after.lost - before.lost), cpu_s / received * 1e6);
}

int run_bus(const std::string& interface, std::chrono::seconds seconds) {
  place(Placement::two_cores);
  std::vector<std::string> urls;
  for (int node = 0; node < 8; ++node) {
    urls.push_back("can://" + interface + "?node=" + std::to_string(node));
  }
  std::printf("eight boards on %s   sent/s  received/s     lost  us a datagram\n",
              interface.c_str());
  {
    const BoardsProcess boards(urls, 1000);
    const Fleet fleet(urls, test::at_will());
    measure_bus("a fleet, one socket", boards, seconds, [&fleet] {
      const Sums sums = sums_of(fleet);
      return Counts{sums.received, sums.lost};
    });
  }
  const BoardsProcess boards(urls, 1000);
  std::vector<std::unique_ptr<Board>> each;
  for (const std::string& url : urls) each.push_back(std::make_unique<Board>(url, test::at_will()));
  measure_bus("a socket a board", boards, seconds, [&each] {
    Counts counts;
    for (const auto& board : each) {
      const Statistics statistics = board->statistics();
      counts.received += statistics.received;
      counts.lost += statistics.packets.lost;
    }
    return counts;
  });
  return 0;
}

int run(std::vector<std::size_t> counts, std::chrono::seconds seconds) {
  place(Placement::two_cores);
  allow_files(*std::max_element(counts.begin(), counts.end()));
  const double reference_us = alone_us();
  std::printf(
      "one board as fast as it goes: %.2f us a datagram of the host\n"
      "                         host: a datagram          a board  simulated:        ms: post to  "
      "stop   silence\n"
      "boards datagrams   lost       us  times  %% core       kB us/state       kB       all of "
      "all    noticed\n"
      "       a second\n",
      reference_us);
  for (const std::size_t count : counts) measure(count, seconds, reference_us);
  return all_met ? 0 : 1;
}

}  // namespace
}  // namespace r4::bench

int main(int argc, char** argv) {
  std::vector<std::size_t> counts{1, 10, 100, 1000};
  const std::chrono::seconds seconds(argc > 2 ? std::atoi(argv[2]) : 5);
  const bool bus = argc > 1 && std::atoi(argv[1]) == 0;
  if (argc > 1) counts = {static_cast<std::size_t>(std::max(1, std::atoi(argv[1])))};
  try {
    return bus ? r4::bench::run_bus(argv[1], seconds) : r4::bench::run(counts, seconds);
  } catch (const r4::Error& error) {
    std::fprintf(stderr, "r4_fleet_bench: %s\n", error.what());
    return 1;
  }
}
