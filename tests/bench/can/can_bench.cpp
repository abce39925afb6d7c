// SPDX-License-Identifier: GPL-3.0-or-later
// A CAN bus against the kernel's own ISO-TP (CAN_ISOTP with CAN_ISOTP_FRAME_TXTIME_ZERO), on vcan0:
//
//     tools/with-can build/tests/bench/r4_can_bench [rounds, default 9
//                  [part: round-trip or throughput]]
//
// Round trip: a command and the state that confirms it, through all of the stack on both sides,
// beside blocking sockets that send as many bytes to and fro. Throughput: datagrams of 170 bytes one
// way. Ours and theirs take turns; the ratio is that of a round, and the median of the rounds
// counts. Exit code 1 if a bar of the plan is missed: round trip p50 at most 1.2 times the kernel's,
// throughput no less than the kernel's.
#include <algorithm>
#include <asio/io_context.hpp>
#include <asio/steady_timer.hpp>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>
#include <vector>

#include "can_processes.hpp"
#include "host/async_board.hpp"
#include "transports/registry.hpp"

namespace r4::bench {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr int trips = 150;  // a round
constexpr std::uint32_t datagrams = 300;
constexpr std::size_t datagram_size = 170;

bool all_met = true;

const char* verdict(bool met) {
  all_met = all_met && met;
  return met ? "met" : "MISSED";
}

double quantile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}
double median(std::vector<double> values) { return quantile(std::move(values), 0.5); }

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

[[noreturn]] void give_up(const char* what) {
  std::fprintf(stderr, "r4_can_bench: %s\n", what);
  std::exit(1);
}

template <class Done>
void run_until(asio::io_context& io, Done done) {
  const auto deadline = Clock::now() + 20s;
  while (!done()) {
    io.run_one_for(1s);
    if (Clock::now() > deadline) give_up("nothing comes any more");
  }
}

// --- round trip

// Commands one after the other; each is sent when the state that confirms the one before has come.
class Host {
 public:
  explicit Host(const std::string& url) : board_(io_, url) { board_.open(); }

  void await_control() {
    run_until(io_, [this] { return board_.in_control(); });
    asio::steady_timer timer(io_, 150ms);
    bool over = false;
    timer.async_wait([&](const std::error_code&) { over = true; });
    run_until(io_, [&] { return over && board_.in_control(); });
  }

  std::vector<double> round_trips(int count) {
    seconds_.clear();
    left_ = count;
    ask();
    run_until(io_, [this] { return left_ == 0; });
    return seconds_;
  }

 private:
  struct Confirmed {
    Host& host;
    void operator()(const CommandResult& result) const {
      if (result.outcome != Outcome::confirmed) give_up("a command was not confirmed");
      host.seconds_.push_back(seconds_since(host.start_));
      if (--host.left_ > 0) host.ask();
    }
  };
  void ask() {
    start_ = Clock::now();
    board_.async_send(Command::osmc(100 + left_, Direction::forward, 1), 1s, Confirmed{*this});
  }

  asio::io_context io_{ASIO_CONCURRENCY_HINT_UNSAFE};
  AsyncBoard board_;
  std::vector<double> seconds_;
  int left_ = 0;
  Clock::time_point start_;
};

std::vector<double> kernel_round_trips(test::KernelIsotp& dialogue, test::KernelIsotp& telemetry,
                                       const std::string& command, int count) {
  std::vector<double> seconds;
  std::string state(max_datagram, '\0');
  while (count-- > 0) {
    const auto start = Clock::now();
    dialogue.send(command);
    telemetry.await_datagram(state.data(), state.size());
    seconds.push_back(seconds_since(start));
  }
  return seconds;
}

void compare_round_trips(int rounds) {
  // About ours: a command has 51; what the board sends is measured below, heartbeats included.
  constexpr std::size_t command_size = 57;
  constexpr std::size_t state_size = 172;
  KernelEchoProcess echo(state_size);
  CanBoardProcess board;
  test::KernelIsotp dialogue = kernel_dialogue(false);
  test::KernelIsotp telemetry = kernel_telemetry(false);
  Host host(CanBoardProcess::url());

  std::vector<double> ours, theirs, ratios;
  std::size_t size = 0;
  for (int round = 0; round <= rounds; ++round) {
    board.let_time_pass(true);
    host.await_control();
    board.let_time_pass(false);
    host.round_trips(10);
    board.mean_size();
    const std::vector<double> a = host.round_trips(trips);
    size = board.mean_size();
    const std::vector<double> b =
        kernel_round_trips(dialogue, telemetry, std::string(command_size, 'c'), trips);
    if (round == 0) continue;  // what is made once has been made
    ours.insert(ours.end(), a.begin(), a.end());
    theirs.insert(theirs.end(), b.begin(), b.end());
    ratios.push_back(median(a) / median(b));
  }
  std::printf(
      "  kernel sockets           p50 %7.0f us   p99 %7.0f us   (%zu bytes, answered by %zu)\n",
      median(theirs) * 1e6, quantile(theirs, 0.99) * 1e6, command_size, state_size);
  std::printf("  async_send, confirmed    p50 %7.0f us   p99 %7.0f us   (answered by %zu, mean)\n",
              median(ours) * 1e6, quantile(ours, 0.99) * 1e6, size);
  std::printf("  ratio %.2f (rounds %.2f to %.2f), bar 1.20: %s\n", median(ratios),
              quantile(ratios, 0), quantile(ratios, 1), verdict(median(ratios) <= 1.2));
}

// --- throughput

// Our end that receives.
class Receiver : Carrier::Handler {
 public:
  explicit Receiver(Lane lane)
      : carrier_(Registry::standard().make(io_, CanBoardProcess::url(),
                                           lane == Lane::telemetry ? Role::host : Role::board)) {
    carrier_->open(*this);
  }

  double rate(const CanSenderProcess& sender) {
    sender_ = &sender;
    count_ = 0;
    const auto start = Clock::now();
    sender.begin(datagrams);
    run_until(io_, [this] { return count_ == datagrams; });
    return datagrams / seconds_since(start);
  }

 private:
  void on_datagram(std::string_view bytes, Peer) override {
    if (bytes.size() != datagram_size) give_up("a datagram has changed");
    ++count_;
    sender_->received();
  }
  void on_carrier_event(const CarrierEvent&) override {}

  asio::io_context io_{ASIO_CONCURRENCY_HINT_UNSAFE};
  std::unique_ptr<Carrier> carrier_;
  const CanSenderProcess* sender_ = nullptr;
  std::uint32_t count_ = 0;
};

double kernel_rate(test::KernelIsotp& socket, const CanSenderProcess& sender) {
  std::string datagram(max_datagram, '\0');
  const auto start = Clock::now();
  sender.begin(datagrams);
  for (std::uint32_t i = 0; i < datagrams; ++i) {
    if (socket.await_datagram(datagram.data(), datagram.size()) != datagram_size) {
      give_up("a datagram of the kernel has changed");
    }
    sender.received();
  }
  return datagrams / seconds_since(start);
}

void compare_throughput(Lane lane, int rounds) {
  const CanSenderProcess our_sender(CanStack::ours, lane, datagram_size);
  const CanSenderProcess their_sender(CanStack::kernel, lane, datagram_size);
  Receiver receiver(lane);
  test::KernelIsotp socket =
      lane == Lane::telemetry ? kernel_telemetry(false) : kernel_dialogue(true);

  std::vector<double> ours, theirs, ratios;
  for (int round = 0; round <= rounds; ++round) {
    const double a = receiver.rate(our_sender);
    const double b = kernel_rate(socket, their_sender);
    if (round == 0) continue;
    ours.push_back(a);
    theirs.push_back(b);
    ratios.push_back(a / b);
  }
  std::printf(
      "  %-34s kernel %6.0f/s   ours %6.0f/s   ratio %.2f (rounds %.2f to %.2f), bar 1.00: %s\n",
      lane == Lane::telemetry ? "telemetry, without flow control" : "dialogue, with flow control",
      median(theirs), median(ours), median(ratios), quantile(ratios, 0), quantile(ratios, 1),
      verdict(median(ratios) >= 1));
}

int run(int rounds, const std::string& part) {
  const auto wanted = [&](const char* name) { return part.empty() || part == name; };
  for (const Placement placement : {Placement::two_cores, Placement::one_core}) {
    place(placement);
    std::printf("%s\n", to_text(placement));
    if (wanted("round-trip")) {
      std::printf("round trip of a command and the state that confirms it, %d rounds of %d\n",
                  rounds, trips);
      compare_round_trips(rounds);
    }
    if (wanted("throughput")) {
      std::printf("datagrams of %zu bytes one way, %d rounds of %u\n", datagram_size, rounds,
                  datagrams);
      for (const Lane lane : {Lane::telemetry, Lane::dialogue}) compare_throughput(lane, rounds);
    }
    std::fflush(stdout);
  }
  return all_met ? 0 : 1;
}

}  // namespace
}  // namespace r4::bench

int main(int argc, char** argv) {
  const int rounds = argc > 1 ? std::atoi(argv[1]) : 9;
  try {
    return r4::bench::run(std::max(rounds, 1), argc > 2 ? argv[2] : "");
  } catch (const std::exception& error) {
    std::fprintf(stderr, "r4_can_bench: %s\n", error.what());
    return 1;
  }
}
