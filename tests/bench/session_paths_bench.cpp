// SPDX-License-Identifier: GPL-3.0-or-later
// The host's cost of receiving states over two paths: one session that handles each state once,
// compared with two sessions of one path each. The limit is 1.2 times the cost for the same
// datagrams, and no allocation.
#include <benchmark/benchmark.h>

#include <array>
#include <cstdlib>
#include <string>

#include "allocations.hpp"
#include "r4link/messages/datagram_writer.hpp"
#include "tests/support/driven_session.hpp"

namespace r4::bench {
namespace {

class Receiver final : test::DrivenSession::Handler {
 public:
  explicit Receiver(std::size_t paths) {
    SessionOptions options;
    options.arming = Arming::off;
    test::DrivenSession::Handler& handler = *this;
    session_.emplace(handler, options, BoardRole::control, paths);
    for (std::size_t path = 0; path < paths; ++path) {
      session_->on_transport(path, true, Time{0});
      session_->poll(now(0));
      if (sid_.empty()) continue;  // a session sends no question on its only path
      write("I:R4,0.1.0,board,udp;ASKED:" + std::to_string(asked_) + ";SID:" + sid_, 0, 0);
      receive(path, 0);
    }
    session_->poll(now(0));
    write("H:R4-ROS2", 1, 0);
    receive(0, 0);
    session_->poll(now(0));
  }
  void receive(std::size_t path, std::uint32_t ms) {
    session_->receive(path, {bytes_.data(), size_}, now(ms));
  }
  void write(const std::string& fields, std::uint32_t pnum, std::uint32_t ms) {
    std::copy(fields.begin(), fields.end(), bytes_.begin());
    DatagramWriter writer(bytes_.data(), bytes_.size(), fields.size());
    size_ = writer.finish(pnum, 79'090 + ms).size();
  }
  std::uint64_t states = 0;

 private:
  static Time now(std::uint32_t ms) { return std::chrono::seconds{10} + Time{1000LL * ms}; }
  SendResult transmit(std::size_t, std::string_view bytes, Priority) override {
    Datagram datagram;
    if (bytes.front() == 'Q' && read_datagram(bytes, datagram)) {
      asked_ = datagram.pnum();
      sid_ = bytes.substr(bytes.find("SID:") + 4, 16);
    }
    return SendResult::sent;
  }
  void on_state(const ReceivedState&, const Datagram&) override { ++states; }
  void on_board_heartbeat(const Datagram&) override {}
  void on_identity(const Identity&) override {}
  void on_nack(const Nack&, const Datagram&) override {}
  void on_bad_datagram(const ReadResult&, std::string_view) override { std::abort(); }
  void on_link(const LinkStatus&) override {}
  void on_result(Ticket, const CommandResult&) override {}

  std::optional<test::DrivenSession> session_;
  std::uint32_t asked_ = 0;
  std::string sid_;
  std::array<char, max_datagram> bytes_;
  std::size_t size_ = 0;
};

const std::string fields =
    "AIN24:24.28;AIN12:12.12;AIN5:5.12;AINDMH:12.11;DMHSTA:1;AINSTEER:1.03;DHB1A:4095,1;"
    "OSMC1:400,1;STEP1POS:-100;SERVO1POS:2000;SAFE:0";

// Each state is received twice: by two sessions, or over two paths by one session.
template <class Receive>
void both(benchmark::State& bench, Receiver& writer, Receive receive) {
  std::uint32_t ms = 0;
  std::uint32_t pnum = 1;
  const std::uint64_t before = allocations();
  for (auto _ : bench) {
    ms += 10;
    writer.write(fields, ++pnum, ms);
    receive(ms);
  }
  bench.counters["allocations"] = static_cast<double>(allocations() - before);
}

void two_sessions_of_one_path(benchmark::State& bench) {
  Receiver a(1);
  Receiver b(1);
  std::uint32_t pnum = 1;
  both(bench, a, [&](std::uint32_t ms) {
    b.write(fields, ++pnum, ms);
    a.receive(0, ms);
    b.receive(0, ms);
  });
  if (a.states == 0 || b.states != a.states) bench.SkipWithError("not all states were told");
}
BENCHMARK(two_sessions_of_one_path);

void one_session_of_two_paths(benchmark::State& bench) {
  Receiver both_paths(2);
  std::uint32_t pnum = 1;
  std::uint64_t turns = 0;
  both(bench, both_paths, [&](std::uint32_t ms) {
    both_paths.receive(0, ms);
    both_paths.write(fields, ++pnum, ms);
    both_paths.receive(1, ms);
    ++turns;
  });
  if (both_paths.states != turns) bench.SkipWithError("not each state was told once");
}
BENCHMARK(one_session_of_two_paths);

}  // namespace
}  // namespace r4::bench
