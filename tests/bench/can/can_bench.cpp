// SPDX-License-Identifier: GPL-3.0-or-later
// A CAN bus, compared with the kernel's own ISO-TP (CAN_ISOTP with CAN_ISOTP_FRAME_TXTIME_ZERO), on
// vcan0:
//
//     tools/with-can build/tests/bench/r4_can_bench [rounds, default 9
//                  [part: round-trip or throughput]]
//
// Round trip: a command and the state that answers it. The reference is a pair of blocking sockets
// with datagrams of the same sizes. Then our carriers replace the sockets. Throughput: datagrams of
// 170 bytes in one direction. Our two ends use the packed form, the default, which needs fewer
// frames for the same datagrams. The kernel carries the plain datagrams. The kernel and our stack
// take turns. The result is the median of the ratios of all rounds. If a limit is not met, the exit
// code is 1: round trip p50 at most 1.2 times the kernel's, throughput at least the kernel's.
//
// Without a limit, the benchmark also measures our plain form (pack=0), bare frames and async_send.
// Bare frames are the best that a program with its own ISO-TP can reach. async_send has the whole
// stack above the carriers, and simulated chips on the board.
#include <algorithm>
#include <array>
#include <asio/io_context.hpp>
#include <asio/steady_timer.hpp>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bare_frames.hpp"
#include "can_processes.hpp"
#include "r4link/async_board.hpp"
#include "r4link/messages/datagram_writer.hpp"
#include "r4link/messages/packed_form.hpp"
#include "tests/support/at_will.hpp"
#include "transports/registry.hpp"

namespace r4::bench {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using Passed = CanBoardProcess::Passed;

constexpr int trips = 150;  // per round
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

// A state of the board, filled up to 170 bytes by its packet number, because some checksums have
// fewer than eight digits.
std::string make_datagram() {
  constexpr Text fields(
      "AIN24:24.28;AIN12:12.12;AIN5:5.12;AINDMH:12.11;DMHSTA:1;AINSTEER:1.03;DHB1A:4095,1;"
      "OSMC1:400,1;STEP1POS:-100;SERVO1POS:2000;CMD:2147483700");
  char buffer[max_datagram];
  for (std::uint32_t pnum = 7434;; ++pnum) {
    std::memcpy(buffer, fields.data(), fields.size());
    DatagramWriter writer(buffer, sizeof buffer, fields.size());
    const Text datagram = writer.finish(pnum, 179090);
    if (datagram.size() == datagram_size) return {datagram.data(), datagram.size()};
    if (pnum > 20000) give_up("no state has the size");
  }
}

std::string make_command() {
  constexpr Text fields("O:358,1,1");
  char buffer[max_datagram];
  std::memcpy(buffer, fields.data(), fields.size());
  const Text datagram =
      DatagramWriter(buffer, sizeof buffer, fields.size()).finish(2147483650, 6037);
  return {datagram.data(), datagram.size()};
}

// --- round trip

// Sends each command after the state that confirms the previous command.
class Host {
 public:
  explicit Host(const std::string& url) : board_(io_, url, test::at_will()) { board_.open(); }

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

  Passed sent() const {
    const CarrierCounters& counters = board_.carrier_counters();
    return {counters.tx_datagrams, counters.tx_bytes};
  }

 private:
  struct Confirmed {
    Host& host;
    void operator()(const CommandResult& result) const {
      // While the board's clock is stopped, a lost state is not repeated.
      if (result.outcome == Outcome::confirmed) {
        host.seconds_.push_back(seconds_since(host.start_));
        --host.left_;
      } else if (++host.lost_ > trips / 10) {
        give_up("commands are not confirmed");
      }
      if (host.left_ > 0) host.ask();
    }
  };
  void ask() {
    start_ = Clock::now();
    board_.async_send(Command::osmc(1, Pwm(100 + left_), Direction::forward), 200ms,
                      Confirmed{*this});
  }

  asio::io_context io_{ASIO_CONCURRENCY_HINT_UNSAFE};
  AsyncBoard board_;
  std::vector<double> seconds_;
  int left_ = 0;
  int lost_ = 0;
  Clock::time_point start_;
};

// Carriers without a session or a board: the same exchange as with the kernel's sockets.
class Carriers : Carrier::Handler {
 public:
  Carriers(Form form, const std::string& command, const std::string& state)
      : echo_(form, state),
        command_(command),
        carrier_(Registry::standard().make(io_, host_url(form, Above::nothing), Role::host)) {
    carrier_->open(*this);
  }

  std::vector<double> round_trips(int count) {
    seconds_.clear();
    int lost = 0;
    while (static_cast<int>(seconds_.size()) < count) {
      left_ = count - static_cast<int>(seconds_.size());
      ask();
      io_.restart();
      while (left_ > 0 && io_.run_one_for(100ms) != 0) continue;
      if (left_ > 0 && ++lost > count / 10) give_up("states do not come");
    }
    return seconds_;
  }

 private:
  void ask() {
    start_ = Clock::now();
    carrier_->send(command_, Priority::normal);
  }
  void on_datagram(std::string_view, Peer) override {
    seconds_.push_back(seconds_since(start_));
    if (--left_ > 0) ask();
  }
  void on_carrier_event(const CarrierEvent&) override {}

  const CarrierEchoProcess echo_;
  const std::string command_;
  asio::io_context io_{ASIO_CONCURRENCY_HINT_UNSAFE};
  std::unique_ptr<Carrier> carrier_;
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

// Our two ends with one form, and the results.
struct Ours {
  explicit Ours(Form which) : form(which), board(which), host(host_url(which)) {}

  std::vector<double> measure() {
    board.let_time_pass(true);
    host.await_control();
    board.let_time_pass(false);
    host.round_trips(10);
    const Passed host_before = host.sent(), board_before = board.sent();
    std::vector<double> times = host.round_trips(trips);
    host_sent = host.sent() - host_before;
    board_sent = board.sent() - board_before;
    return times;
  }

  const Form form;
  CanBoardProcess board;
  Host host;
  Passed host_sent, board_sent;  // in the last round
};

void compare_round_trips(int rounds) {
  const std::string command = make_command(), state = make_datagram();
  KernelEchoProcess echo;
  test::KernelIsotp dialogue = kernel_dialogue(false);
  test::KernelIsotp telemetry = kernel_telemetry(false);
  const std::string question =
      KernelEchoProcess::question(command.size(), static_cast<std::uint16_t>(state.size()));
  Carriers plain(Form::plain, command, state), packed(Form::packed, command, state);
  Ours plain_stack(Form::plain), packed_stack(Form::packed);

  struct Row {
    const char* name;
    bool barred;
    std::function<std::vector<double>()> measure;
    std::vector<double> seconds, ratios;
  };
  const auto bare = [&](Wait wait) {
    return bare_round_trips(wait, frames_of(command.size()), frames_of(state.size()), trips);
  };
  std::array<Row, 6> rows{
      Row{"carriers, packed", true, [&] { return packed.round_trips(trips); }, {}, {}},
      Row{"async_send, packed", false, [&] { return packed_stack.measure(); }, {}, {}},
      Row{"carriers, plain", false, [&] { return plain.round_trips(trips); }, {}, {}},
      Row{"async_send, plain", false, [&] { return plain_stack.measure(); }, {}, {}},
      Row{"bare frames, sleeping", false, [&] { return bare(Wait::sleeping); }, {}, {}},
      Row{"bare frames, looking", false, [&] { return bare(Wait::looking); }, {}, {}}};
  std::vector<double> theirs;
  for (int round = 0; round <= rounds; ++round) {
    const std::vector<double> kernel = kernel_round_trips(dialogue, telemetry, question, trips);
    if (round != 0) theirs.insert(theirs.end(), kernel.begin(), kernel.end());
    for (Row& row : rows) {
      const std::vector<double> times = row.measure();
      if (round == 0) continue;  // the first round also includes one-time setup
      row.seconds.insert(row.seconds.end(), times.begin(), times.end());
      row.ratios.push_back(median(times) / median(kernel));
    }
  }
  std::printf("  %-22s p50 %6.0f us   p99 %6.0f us   (%zu bytes, answered by %zu)\n",
              "kernel sockets, plain", median(theirs) * 1e6, quantile(theirs, 0.99) * 1e6,
              command.size(), state.size());
  for (const Row& row : rows) {
    std::printf("  %-22s p50 %6.0f us   p99 %6.0f us   ratio %.2f (rounds %.2f to %.2f)", row.name,
                median(row.seconds) * 1e6, quantile(row.seconds, 0.99) * 1e6, median(row.ratios),
                quantile(row.ratios, 0), quantile(row.ratios, 1));
    if (row.barred) std::printf(", bar 1.20: %s", verdict(median(row.ratios) <= 1.2));
    std::printf("\n");
  }
  for (const Ours* ours : {&packed_stack, &plain_stack}) {
    std::printf("  (async_send, %s: %zu bytes, answered by %zu, mean)\n", to_text(ours->form),
                ours->host_sent.mean_size(), ours->board_sent.mean_size());
  }
}

// --- throughput

std::size_t packed_size(const std::string& datagram) {
  std::uint8_t bytes[max_datagram];
  return pack(Text(datagram.data(), datagram.size()), bytes, sizeof bytes);
}

class Receiver : Carrier::Handler {
 public:
  Receiver(Form form, Lane lane)
      : carrier_(Registry::standard().make(
            io_, lane == Lane::telemetry ? host_url(form) : board_url(form),
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
  const std::string datagram = make_datagram();
  const CanSenderProcess plain(Form::plain, lane, datagram), packed(Form::packed, lane, datagram);
  const CanSenderProcess kernel(std::nullopt, lane, datagram);
  Receiver plain_receiver(Form::plain, lane), packed_receiver(Form::packed, lane);
  test::KernelIsotp socket =
      lane == Lane::telemetry ? kernel_telemetry(false) : kernel_dialogue(true);

  const BareSenderProcess bare(lane, frames_of(datagram.size()));

  struct Stream {
    const char* name;
    bool barred;
    std::function<double()> measure;
    std::vector<double> rates, ratios;
  };
  std::array<Stream, 3> streams{
      Stream{"carriers, packed", true, [&] { return packed_receiver.rate(packed); }, {}, {}},
      Stream{"carriers, plain", false, [&] { return plain_receiver.rate(plain); }, {}, {}},
      Stream{"bare frames, looking", false, [&] { return bare.rate(datagrams); }, {}, {}}};
  std::vector<double> theirs;
  for (int round = 0; round <= rounds; ++round) {
    const double reference = kernel_rate(socket, kernel);
    if (round != 0) theirs.push_back(reference);
    for (Stream& stream : streams) {
      const double rate = stream.measure();
      if (round == 0) continue;
      stream.rates.push_back(rate);
      stream.ratios.push_back(rate / reference);
    }
  }
  std::printf(
      "  %s\n    %-22s %6.0f/s\n",
      lane == Lane::telemetry ? "telemetry, without flow control" : "dialogue, with flow control",
      "kernel sockets, plain", median(theirs));
  for (const Stream& stream : streams) {
    std::printf("    %-22s %6.0f/s   ratio %.2f (rounds %.2f to %.2f)", stream.name,
                median(stream.rates), median(stream.ratios), quantile(stream.ratios, 0),
                quantile(stream.ratios, 1));
    if (stream.barred) std::printf(", bar 1.00: %s", verdict(median(stream.ratios) >= 1));
    std::printf("\n");
  }
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
      std::printf("datagrams of %zu bytes (packed: %zu) one way, %d rounds of %u\n", datagram_size,
                  packed_size(make_datagram()), rounds, datagrams);
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
