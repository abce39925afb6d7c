// SPDX-License-Identifier: GPL-3.0-or-later
// How long an emergency stop takes through a bridge from UDP to a full CAN bus. A board sends
// states as fast as the bus carries them, and the bridge passes on each state. Meanwhile a host
// sends commands.
//
// The bridge, its carriers, UDP and the loop are real. The bus is exact to the bit. The clock of
// the bus stops while the bridge works.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>

#include <algorithm>
#include <asio/io_context.hpp>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "host/bridge/bridged_pair.hpp"
#include "host/standard_registry.hpp"
#include "modelled_controller.hpp"
#include "tests/support/datagrams.hpp"
#include "transports/framing/can/can_node.hpp"

namespace r4::test {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::uint8_t number = 3;
constexpr std::uint64_t ms_ns = 1000000;
constexpr std::chrono::seconds patience{60};  // for a slow machine

// Sends one state after another, and counts the datagrams that it receives.
class TalkingBoard {
 public:
  explicit TalkingBoard(CanBusModel& bus) : bus_(bus), node_(CanEnd::board, number, false) {
    CanNodeOptions options;
    options.sent = [this](const CanFrame&) { bus_.at(bus_.now_ns(), [this] { pump(); }); };
    options.received = [this](const CanFrame& frame) {
      if (!node_.on_frame(frame, bus_.now_us()).empty()) ++told;
      bus_.at(bus_.now_ns(), [this] { pump(); });
    };
    controller_ = bus.add_node(std::move(options));
    pump();
  }

  std::uint64_t said = 0;
  std::uint64_t told = 0;

 private:
  void pump() {
    node_.poll(bus_.now_us());
    if (node_.idle(CanLane::telemetry)) {
      node_.begin(Text(state()), bus_.now_us());
      ++said;
    }
    // The frames of a transfer follow each other.
    CanFrame frame{};
    while (bus_.waiting(controller_) < 1 && node_.offer(bus_.now_us(), frame)) {
      bus_.send(controller_, frame);
      node_.frame_sent(bus_.now_us());
    }
  }
  std::string state() const {
    return with_crc(
        "AIN24:24.28;AIN12:12.15;AIN5V:5.02;AIN3V3:3.31;SERVO1POS:300;SERVO2POS:300;"
        "DHB1A:1000,1;ESTOP:1;PNum:" +
        std::to_string(100000 + said) + ";T:" + std::to_string(bus_.now_us() / 1000) + ";");
  }

  CanBusModel& bus_;
  CanNode node_;
  int controller_ = 0;
};

// The bus, the bridge to the bus, and a socket of a host.
class BridgeToAFullBus {
 public:
  explicit BridgeToAFullBus(const ControllerOptions& options) : controller(bus, options) {
    CanNodeOptions listener;
    listener.silent = true;
    listener.received = [this](const CanFrame& frame) { heard.push_back(frame); };
    bus.add_node(std::move(listener));

    BridgedPair::Setup setup;
    setup.hosts = standard_registry().make(io, "udp://127.0.0.1:0", Role::board);
    setup.board = make_host_carrier(io, "can://model?node=3&pack=0", BoardRole::control);
    pair = std::make_unique<BridgedPair>(std::move(setup));
    pair->open();
    const std::string listens = pair->status().hosts.name;  // udp://127.0.0.1:PORT
    const auto port = std::stoul(listens.substr(listens.rfind(':') + 1));
    to_.sin_family = AF_INET;
    to_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    to_.sin_port = htons(static_cast<std::uint16_t>(port));
  }

  void say(const std::string& fields) {
    const std::string bytes = with_crc(fields + ";PNum:" + std::to_string(pnum_++) + ";T:0;");
    const auto* const to = reinterpret_cast<const sockaddr*>(&to_);
    ::sendto(socket_.get(), bytes.data(), bytes.size(), 0, to, sizeof to_);
  }
  // The bridge does all pending work while the clock of the bus is stopped.
  void settle() {
    pair->tick();
    do controller.pump();
    while (io.poll() != 0);
  }
  // The bus runs until then_ns. The bridge reacts to each event at the time of the event.
  void run_until(std::uint64_t then_ns) {
    while (bus.next_ns() <= then_ns) {
      bus.run_until(bus.next_ns());
      settle();
    }
    bus.run_until(then_ns);
  }
  template <class Predicate>
  testing::AssertionResult comes(Predicate true_now) {
    const Clock::time_point give_up = Clock::now() + patience;
    while (!true_now()) {
      if (Clock::now() > give_up)
        return testing::AssertionFailure() << "the awaited event does not come";
      run_until(bus.now_ns() + ms_ns);
    }
    return testing::AssertionSuccess();
  }
  std::uint64_t stops() const { return pair->status().hosts.from.stops; }

  asio::io_context io;
  CanBusModel bus{{.rate = {1000000, 0}, .seed = 1}};
  ModelledController controller;
  TalkingBoard board{bus};
  std::unique_ptr<BridgedPair> pair;
  std::vector<CanFrame> heard;

 private:
  FileDescriptor socket_{::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)};
  sockaddr_in to_{};
  std::uint32_t pnum_ = 1;
};

bool is_bare_stop(const CanFrame& frame) {
  return !frame.extended && frame.id == emergency_stop_id;
}

// The stop follows the frame in progress and at most `frames_between` other frames of the bridge.
void expect_stops(const ControllerOptions& options, std::uint64_t frames_between) {
  constexpr std::uint64_t stops = 400;
  BridgeToAFullBus world(options);
  ASSERT_TRUE(world.comes([&] {
    world.say("H:ROS2-R4");
    return world.board.told != 0;  // the bridge serves a host, so it listens on the bus
  }));
  simulation::Random random(2);
  std::uint64_t max_ns = 0;
  std::uint64_t full = 0;
  const std::uint64_t began_ns = world.bus.now_ns();
  const std::uint64_t said_before = world.board.said;
  const std::uint64_t passed_before = world.pair->status().board.from.passed;
  for (std::uint64_t i = 0; i < stops; ++i) {
    world.say("H:ROS2-R4");
    world.say("S:1500,1");
    // Half of the stops are sent at any time. The other half are sent while more frames wait than
    // the controller accepts.
    const bool at_any_time = i % 2 == 0;
    for (int frames = 0; frames < 100 && !at_any_time; ++frames) {
      if (world.controller.waiting() >= options.room) break;
      world.run_until(world.bus.next_ns());
    }
    world.run_until(world.bus.now_ns() + random.below(at_any_time ? 30 * ms_ns : ms_ns / 5));
    const std::uint64_t asked_ns = world.bus.now_ns();
    world.heard.clear();
    full += world.controller.waiting() >= options.room ? 1 : 0;
    const std::uint64_t before = world.stops();
    world.say("E:STOP");
    for (const auto give_up = Clock::now() + patience; world.stops() == before;) {
      ASSERT_LT(Clock::now(), give_up);
      world.settle();
    }
    world.settle();
    while (world.heard.empty() || !is_bare_stop(world.heard.back())) {
      ASSERT_LE(world.heard.size(), 1 + frames_between) << "stop " << i;
      world.run_until(world.bus.next_ns());
    }
    max_ns = std::max(max_ns, world.bus.now_ns() - asked_ns);
  }
  const BridgeStatus status = world.pair->status();
  const std::uint64_t said = world.board.said - said_before;
  const std::uint64_t passed = status.board.from.passed - passed_before;
  CanFrame stop{};
  stop.id = emergency_stop_id;
  const std::uint64_t bound_us =
      (1 + frames_between) * total(worst_can_bits(max_classic_size, false, false)) +
      total(can_bits(stop)) - can_intermission_bits;
  std::printf(
      "a stop is on the bus at most %.1f us after it was asked for (bound %d); the controller was "
      "full at %d of %d stops, and %d of %d states passed\n",
      static_cast<double>(max_ns) / 1e3, static_cast<int>(bound_us), static_cast<int>(full),
      static_cast<int>(stops), static_cast<int>(passed), static_cast<int>(said));
  EXPECT_EQ(status.hosts.from.stops, stops);
  EXPECT_LE(max_ns, bound_us * 1000);
  EXPECT_GT(max_ns, bound_us * 1000 / 2) << "no stop was sent while a frame was in progress";
  EXPECT_GT(full, stops / 4) << "the controller was rarely full";
  EXPECT_GT(static_cast<double>(world.bus.busy_ns()),
            0.99 * static_cast<double>(world.bus.now_ns()));
  // Transfers may be cancelled during a standstill of the machine.
  EXPECT_GT(passed, said / 2);
  EXPECT_GT(said, (world.bus.now_ns() - began_ns) / (10 * ms_ns));
}

TEST(BridgeStop, IsNextOnTheBusAfterTheFrameInProgress) { expect_stops({}, 0); }

TEST(BridgeStop, WaitsForTheFramesAlreadyInAFifo) {
  expect_stops({.queue = CanQueue::fifo, .room = 3, .kept = 1}, 3);
}

}  // namespace
}  // namespace r4::test
