// SPDX-License-Identifier: GPL-3.0-or-later
// How long an emergency stop takes on a bus that is exact to the bit. Eight boards run the
// firmware's application on their CAN nodes. A host stops all boards with one frame.
//
// The host's controller has a mailbox that only the stop uses, or the controller is a FIFO. In a
// FIFO the stop is sent after all waiting frames. A board's loop takes the received frames, calls
// the application when it is due, and fills its controller. The loop runs at least once a
// millisecond, at its own times, and keeps one mailbox free of telemetry.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "tests/firmware/board_fixture.hpp"
#include "tests/support/can_bus_model.hpp"
#include "transports/framing/can/can_node.hpp"

namespace r4::test {
namespace {

constexpr int board_count = 8;
constexpr std::uint64_t ms_ns = 1000000;
constexpr std::uint64_t state_period_ns = 10 * ms_ns;
constexpr std::uint64_t never = ~std::uint64_t{0};
constexpr std::size_t mailboxes = 3;

CanFrame stop_frame() {
  CanFrame frame{};
  frame.id = emergency_stop_id;
  return frame;
}

std::uint32_t to_ms(std::uint64_t ns) { return static_cast<std::uint32_t>(ns / ms_ns) + 500000; }

// One board: application, CAN node, controller, and the loop.
class StoppedBoard final : private firmware::Port {
 public:
  StoppedBoard(CanBusModel& bus, std::uint8_t number, std::uint64_t seed)
      : bus_(bus), random_(seed), node_(CanEnd::board, number, false), application_(hal, config()) {
    CanNodeOptions options;
    options.room = mailboxes;
    options.received = [this](const CanFrame& frame) { came_.push_back(frame); };
    controller_ = bus_.add_node(options);
    application_.add_port(*this);
    application_.start(to_ms(0));
    again();
  }

  bool safe() const { return hal.outputs == firmware::Outputs(); }
  bool drives() const { return application_.state() == firmware::BoardState::active && !safe(); }
  std::uint32_t timeouts() const {
    return node_.sent(CanLane::telemetry).send_timeout +
           node_.received(CanLane::dialogue).consecutive_timeout;
  }

  MemoryHal hal;
  std::uint64_t safe_ns = 0;  // when the outputs became safe

 private:
  static firmware::Application::Config config() {
    firmware::Application::Config config;
    config.identity.firmware = "1";
    config.identity.board_id = "R4";
    return config;
  }
  void again() {
    bus_.at(bus_.now_ns() + random_.between(ms_ns / 10, ms_ns), [this] {
      loop();
      again();
    });
  }
  void loop() {
    const bool was_safe = safe();
    const std::uint32_t now_ms = to_ms(bus_.now_ns());
    while (!came_.empty()) {
      const Text datagram = node_.on_frame(came_.front(), bus_.now_us());
      came_.pop_front();
      if (!datagram.empty()) application_.receive(0, 1, datagram, now_ms);
    }
    application_.poll(now_ms);
    if (!was_safe && safe()) safe_ns = bus_.now_ns();
    node_.poll(bus_.now_us());
    CanFrame frame;
    for (;;) {
      begin_waiting();
      if (!node_.offer(bus_.now_us(), frame)) break;
      const bool telemetry = classify(frame).kind == CanIdKind::telemetry;
      if (bus_.waiting(controller_) + (telemetry ? 1 : 0) >= mailboxes) break;
      bus_.send(controller_, frame);
      node_.frame_sent(bus_.now_us());
    }
  }
  void begin_waiting() {
    if (!waiting_.empty() && node_.begin(Text(waiting_.front()), bus_.now_us())) {
      waiting_.pop_front();
    } else if (waiting_.empty() && !state_.empty() && node_.begin(Text(state_), bus_.now_us())) {
      state_.clear();
    }
  }

  void send(Text datagram, Priority priority, std::uint32_t) override {
    if (priority == Priority::state) {
      state_ = str(datagram);
    } else {
      waiting_.push_back(str(datagram));
    }
  }
  std::size_t max_size() const override { return max_datagram; }
  void use_packed_form(bool wanted) override { node_.use_packed_form(wanted); }

  CanBusModel& bus_;
  simulation::Random random_;
  CanNode node_;
  firmware::Application application_;
  int controller_ = 0;
  std::deque<CanFrame> came_;
  std::deque<std::string> waiting_;
  std::string state_;
};

// A host of all boards sends heartbeats and commands to each board, and the stop.
class StoppingHost {
 public:
  StoppingHost(CanBusModel& bus, CanQueue queue) : bus_(bus) {
    CanNodeOptions options;
    options.queue = queue;
    options.room = mailboxes + 1;
    options.sent = [this](const CanFrame& frame) {
      if (frame.id == emergency_stop_id) stop_sent_ns = bus_.now_ns();
      bus_.at(bus_.now_ns(), [this] { pump(); });
    };
    options.received = [this](const CanFrame& frame) {
      for (auto& link : links_) link->hear(link->node.on_frame(frame, bus_.now_us()));
      bus_.at(bus_.now_ns(), [this] { pump(); });
    };
    controller_ = bus_.add_node(options);
    for (int i = 0; i < board_count; ++i) links_.push_back(std::make_unique<Link>(i));
    heartbeats();
  }

  void command(int board, const std::string& field) {
    Link& link = *links_[static_cast<std::size_t>(board)];
    link.waiting.push_back(with_crc(field + ";PNum:" + std::to_string(link.pnum++) +
                                    ";T:" + std::to_string(link.board_t) + ";"));
    pump();
  }
  void stop() { ASSERT_TRUE(bus_.send(controller_, stop_frame())); }
  std::int32_t cause(int board) const { return links_[static_cast<std::size_t>(board)]->cause; }

  std::uint32_t timeouts() const {
    std::uint32_t count = 0;
    for (const auto& link : links_) {
      count += link->node.sent(CanLane::dialogue).send_timeout +
               link->node.sent(CanLane::dialogue).flow_control_timeout +
               link->node.received(CanLane::telemetry).consecutive_timeout;
    }
    return count;
  }

  std::uint64_t stop_sent_ns = 0;

 private:
  struct Link {
    explicit Link(int number) : node(CanEnd::host, static_cast<std::uint8_t>(number), false) {
      node.use_packed_form(true);
    }
    void hear(Text bytes) {
      Datagram datagram;
      if (bytes.empty() || !read_datagram(bytes, datagram)) return;
      if (kind_of(datagram) != MessageKind::board_heartbeat) return;
      board_t = datagram.time_ms();
      cause = heartbeat_report(datagram).cause;
    }
    CanNode node;
    std::deque<std::string> waiting;
    std::uint32_t pnum = 12345;
    std::uint64_t board_t = 0;  // T of the board's newest heartbeat, which our heartbeats echo
    std::int32_t cause = 0;     // cause in the same heartbeat
  };

  void heartbeats() {
    for (int i = 0; i < board_count; ++i) command(i, "H:ROS2-R4");
    bus_.at(bus_.now_ns() + 100 * ms_ns, [this] { heartbeats(); });
  }
  void pump() {
    CanFrame frame;
    for (auto& link : links_) {
      link->node.poll(bus_.now_us());
      if (!link->waiting.empty() && link->node.begin(Text(link->waiting.front()), bus_.now_us())) {
        link->waiting.pop_front();
      }
      while (bus_.waiting(controller_) < mailboxes && link->node.offer(bus_.now_us(), frame)) {
        bus_.send(controller_, frame);
        link->node.frame_sent(bus_.now_us());
      }
    }
  }

  CanBusModel& bus_;
  int controller_ = 0;
  std::vector<std::unique_ptr<Link>> links_;
};

using Boards = std::vector<std::unique_ptr<StoppedBoard>>;

// Makes all boards drive again. A board obeys an E:CLEAR only if the E:CLEAR names the newest stop
// that the board has reported. The report may be lost when all boards report their stop at once, so
// the E:CLEAR is repeated.
void drive(CanBusModel& bus, const Boards& boards, StoppingHost& host) {
  for (int attempt = 0; attempt < 20; ++attempt) {
    for (int board = 0; board < board_count; ++board) {
      if (boards[static_cast<std::size_t>(board)]->drives()) continue;
      const std::string clear = "E:CLEAR," + std::to_string(host.cause(board));
      for (const std::string& field : {std::string("H:ROS2-R4"), clear, std::string("O:358,1,1")}) {
        host.command(board, field);
      }
      bus.run_until(bus.now_ns() + 3 * ms_ns);
    }
    bus.run_until(bus.now_ns() + 20 * ms_ns);
    if (std::all_of(boards.begin(), boards.end(), [](auto& each) { return each->drives(); }))
      return;
  }
}

// The stop is sent after at most `frames_before` frames, and every board is safe a millisecond
// later.
void expect_stops(CanQueue queue, std::uint64_t frames_before) {
  constexpr int stops = 1000;
  CanBusModel bus({.rate = {1000000, 0}, .seed = 1});
  simulation::Random random(2);
  Boards boards;
  for (std::uint8_t i = 0; i < board_count; ++i) {
    boards.push_back(std::make_unique<StoppedBoard>(bus, i, random.next()));
  }
  StoppingHost host(bus, queue);
  bus.run_until(300 * ms_ns);

  std::uint64_t max_bus_ns = 0;
  std::uint64_t sum_bus_ns = 0;
  std::uint64_t max_board_ns = 0;
  for (int i = 0; i < stops; ++i) {
    drive(bus, boards, host);
    const std::uint64_t stop_ns = bus.now_ns() + random.below(state_period_ns);
    bus.run_until(stop_ns);
    for (const auto& board : boards) {
      ASSERT_TRUE(board->drives()) << "stop " << i;
      board->safe_ns = never;
    }
    host.stop_sent_ns = never;
    host.stop();
    bus.run_until(stop_ns + state_period_ns);
    ASSERT_NE(host.stop_sent_ns, never);
    max_bus_ns = std::max(max_bus_ns, host.stop_sent_ns - stop_ns);
    sum_bus_ns += host.stop_sent_ns - stop_ns;
    for (const auto& board : boards) {
      ASSERT_NE(board->safe_ns, never) << "stop " << i;
      max_board_ns = std::max(max_board_ns, board->safe_ns - host.stop_sent_ns);
    }
  }
  // The longest possible frames, each with its intermission, and the stop's own frame.
  const std::uint64_t longest_us =
      frames_before * total(worst_can_bits(max_classic_size, false, false));
  const std::uint64_t own_us = total(can_bits(stop_frame())) - can_intermission_bits;
  std::printf(
      "%d stops of %d boards, load %.1f %%: the stop is on the bus after at most %.1f us (mean "
      "%.1f, "
      "bound %d), outputs safe at most %.1f us after it\n",
      stops, board_count, 100 * bus.load(), static_cast<double>(max_bus_ns) / 1e3,
      static_cast<double>(sum_bus_ns) / stops / 1e3, static_cast<int>(longest_us + own_us),
      static_cast<double>(max_board_ns) / 1e3);
  std::uint32_t timeouts = host.timeouts();
  for (const auto& board : boards) timeouts += board->timeouts();
  std::printf("%u transfers timed out in %.1f s\n", timeouts,
              static_cast<double>(bus.now_ns()) / 1e9);
  EXPECT_LE(max_bus_ns, (longest_us + own_us) * 1000);
  EXPECT_GT(max_bus_ns, (longest_us + own_us) * 1000 / 2)
      << "no stop was sent while a frame was in progress";
  EXPECT_LE(max_board_ns, ms_ns);
}

TEST(CanStop, WaitsForAtMostOneFrameIfTheHostHasMailboxes) { expect_stops(CanQueue::mailboxes, 1); }

TEST(CanStop, WaitsAlsoForTheFramesInAFifo) { expect_stops(CanQueue::fifo, 1 + mailboxes); }

}  // namespace
}  // namespace r4::test
