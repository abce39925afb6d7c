// SPDX-License-Identifier: GPL-3.0-or-later
// A CanBus that accepts frames slowly, and a CanBus whose reader is delayed: frames that wait, that
// are late, and that are lost.
#include <algorithm>
#include <fstream>
#include <thread>

#include "r4link/can/can_ids.hpp"
#include "tests/transports/can/kernel/can_bus_fixture.hpp"
#include "transports/framing/can/can_node.hpp"

namespace r4::test {
namespace {

// Offers a number of frames, and records whether each frame was sent, late or dropped.
class Talker final : public CanBus::Member {
 public:
  Talker(std::shared_ptr<CanBus> bus, int frames) : left_(frames), bus_(std::move(bus)) {
    bus_->join(*this, {});
  }
  ~Talker() { bus_->leave(*this); }
  Talker(const Talker&) = delete;
  Talker& operator=(const Talker&) = delete;

  int accepted = 0;
  int late = 0;
  int stuck = 0;

 private:
  bool offer(std::uint32_t, CanFrame& frame) override {
    if (left_ == 0) return false;
    frame = CanFrame{};
    frame.id = other_id;
    frame.size = 1;
    frame.data[0] = static_cast<std::uint8_t>(accepted);
    return true;
  }
  void frame_sent(std::uint32_t) override {
    --left_;
    ++accepted;
  }
  void on_late_frame(const CanFrame&, std::uint32_t) override { ++late; }
  void on_stuck() override {
    left_ = 0;
    ++stuck;
  }
  void on_frame(const CanFrame&, std::uint32_t) override {}
  void on_bus(const CarrierEvent&) override {}

  int left_;
  std::shared_ptr<CanBus> bus_;
};

// `rate`: bits a second. A frame is treated as 128 bits.
class SlowBus {
 public:
  explicit SlowBus(int rate) {
    EXPECT_EQ(0, std::system(("tc qdisc add dev vxcan7 root tbf burst 80 limit 10000 rate " +
                              std::to_string(rate) + "bit")
                                 .c_str()));
  }
  ~SlowBus() { [[maybe_unused]] const int ended = std::system("tc qdisc del dev vxcan7 root"); }
  SlowBus(const SlowBus&) = delete;
  SlowBus& operator=(const SlowBus&) = delete;
};

// A host and its board, at the two ends of the bus.
struct Link {
  Link(asio::io_context& io, std::size_t number)
      : host(make_can_carrier(io, url(near_end, number), Role::host)),
        board(make_can_carrier(io, url(far_end, number), Role::board)) {
    host->open(at_host);
    board->open(at_board);
  }
  static Url url(const std::string& end, std::size_t number) {
    return Url::parse("can://" + end + "?node=" + std::to_string(number));
  }
  static std::uint64_t timed_out(const Carrier& carrier) {
    return carrier.counters().transfers.value().timed_out;
  }

  Recorder at_host, at_board;
  std::unique_ptr<Carrier> host, board;
};

constexpr int most_runs = 20;  // attempts, because this machine may have a standstill during a run

class CanBusLoad : public CanBusTest {};

TEST_F(CanBusLoad, ReportsDelayedFramesAndSendsAllInOrder) {
  const SlowBus slow(16000);
  Talker talker(bus, CanBus::ahead);
  bus->send();
  EXPECT_EQ(talker.accepted, static_cast<int>(CanBus::ahead));
  EXPECT_TRUE(bus->full());
  EXPECT_EQ(talker.late, 0);
  ASSERT_TRUE(run_until([&] { return !bus->full(); }));
  EXPECT_GT(talker.late, talker.accepted / 2) << "the kernel accepts few frames at a time";
  EXPECT_LT(talker.late, talker.accepted) << "the first frames did not wait";
  CanFrame frame;
  for (int i = 0; i < talker.accepted; ++i) {
    ASSERT_TRUE(remote.receive(frame, CanBus::now_us() + 1000000)) << i;
    ASSERT_EQ(frame.data[0], i);
  }
  EXPECT_EQ(talker.stuck, 0);
}

const std::string in_two_frames = "0123456789";

// All first frames together occupy the bus for longer than the time limit of each answer.
TEST_F(CanBusLoad, ADelayedFirstFrameStillHasItsFullAnswerTime) {
  constexpr std::size_t hosts = 16;
  const SlowBus slow(64000);
  bool in_time = false;
  for (int run = 0; run < most_runs && !in_time; ++run) {
    std::vector<std::unique_ptr<Link>> links;
    while (links.size() < hosts) links.push_back(std::make_unique<Link>(io, links.size()));
    run_for(soon);  // a host receives before it sends
    for (const auto& link : links) {
      ASSERT_EQ(link->host->send(in_two_frames, Priority::normal), SendResult::sent);
    }
    const bool full = bus->full();
    std::uint64_t arrived = 0, timed_out = 0;
    ASSERT_TRUE(run_until([&] {
      arrived = timed_out = 0;
      for (const auto& link : links) {
        arrived += link->at_board.datagrams.size();
        timed_out += Link::timed_out(*link->host) + Link::timed_out(*link->board);
      }
      return arrived + timed_out >= links.size();
    }));
    in_time = full && arrived == links.size();
  }
  EXPECT_TRUE(in_time);
}

TEST_F(CanBusLoad, AnUnansweredFirstFrameTimesOutOnAFullBus) {
  Link link(io, node);
  link.board->close();
  run_for(soon);
  const SlowBus slow(16000);
  ASSERT_EQ(link.host->send(in_two_frames, Priority::normal), SendResult::sent);
  Talker talker(bus, 200);
  bus->send();
  ASSERT_TRUE(run_until([&] { return Link::timed_out(*link.host) == 1; }));
  EXPECT_TRUE(bus->full());
  EXPECT_LT(talker.accepted, 200);
}

// A board that always has a state to send must detect that an answer is missing.
TEST_F(CanBusLoad, AnUnansweredDatagramTimesOutNextToALongState) {
  Recorder told;
  const auto board = make_can_carrier(io, Link::url(near_end, node), Role::board);
  board->open(told);
  const SlowBus slow(32000);
  ASSERT_EQ(board->send(std::string(max_datagram, 'A'), Priority::state), SendResult::sent);
  ASSERT_EQ(board->send("N:" + in_two_frames, Priority::normal), SendResult::sent);
  ASSERT_TRUE(run_until([&] { return Link::timed_out(*board) == 1; }));
  EXPECT_TRUE(bus->full()) << "the state must occupy the bus until the time-out";
}

// The frame's time stamp is before the timeout, so this process may read the frame later.
TEST_F(CanBusLoad, ObeysTimelyFlowControlThatIsReadLate) {
  bool in_time = false;
  for (int run = 0; run < most_runs && !in_time; ++run) {
    Link link(io, node);
    link.board->close();
    run_for(soon);
    CanFrame first{};
    RawCan far(command_id(node), far_end);
    const std::uint32_t began_us = CanBus::now_us();
    ASSERT_EQ(link.host->send(in_two_frames, Priority::normal), SendResult::sent);
    ASSERT_TRUE(far.receive(first, CanBus::now_us() + 1000000));
    CanFrame go{};
    go.id = reply_id(node);
    go.size = 3;
    go.data[0] = 0x30;
    far.send(go);
    in_time = CanBus::now_us() - began_us < 20000;
    if (!in_time) continue;
    std::this_thread::sleep_for(std::chrono::milliseconds(40));  // delayed for twice N_Bs
    EXPECT_EQ(link.host->send(in_two_frames, Priority::normal), SendResult::sent);
    CanFrame second{};
    io.restart();
    while (io.run_one_for(soon) != 0 && !far.receive(second, CanBus::now_us())) continue;
    EXPECT_EQ(second.data[0], 0x21) << "the consecutive frame";
    EXPECT_EQ(Link::timed_out(*link.host), 0U);
  }
  EXPECT_TRUE(in_time) << "this computer stood still in every run";
}

TEST_F(CanBusLoad, DropsFramesThatTheBusDoesNotAcceptInTime) {
  Talker talker(bus, CanBus::ahead);
  const auto start = CanBus::Clock::now();
  {
    const SlowBus slow(800);
    bus->send();
    ASSERT_TRUE(run_until([&] { return talker.stuck != 0; }));
    EXPECT_GE(CanBus::Clock::now() - start, CanBus::patience);
    EXPECT_FALSE(bus->full());
    EXPECT_EQ(talker.late, 0);
  }
  // Frames in the queue of the kernel are lost or arrive. No other frame arrives.
  Talker next(bus, 1);
  ASSERT_TRUE(run_until([&] {
    bus->send();
    return next.accepted == 1 && !bus->full();
  }));
}

// --- time stamps of frames

// A datagram of the board in seven frames, which arrive while the reader in this thread is delayed.
class CanBusTimes : public CanBusTest {
 protected:
  static constexpr std::chrono::milliseconds n_cr{100};  // docs/reference/can.md

  struct Sending {
    std::uint32_t before_us;
    std::uint32_t after_us;
  };

  CanBusTimes() {
    reader->open(datagrams);
    CanNode board(CanEnd::board, node, false);
    board.begin(Text("AIN24:24.28;AIN12:12.24;AIN5:5.11;AINDMH:12.1;"), 0);
    for (CanFrame frame; board.offer(0, frame); board.frame_sent(0)) frames.push_back(frame);
  }

  // Sends the next frames, with `gap` before each frame.
  void send(std::size_t count, std::chrono::milliseconds gap) {
    for (; count != 0; --count) {
      std::this_thread::sleep_for(gap);  // the pause itself is part of the test
      const std::uint32_t before_us = CanBus::now_us();
      remote.send(frames[sendings.size()]);
      sendings.push_back({before_us, CanBus::now_us()});
    }
  }
  std::uint32_t least_gap_us(std::size_t n) const {
    return sendings[n].before_us - sendings[n - 1].after_us;
  }
  std::uint32_t most_gap_us(std::size_t n) const {
    return sendings[n].after_us - sendings[n - 1].before_us;
  }
  void read_all() {
    ASSERT_TRUE(run_until([&] { return member.frames.size() == sendings.size(); }));
  }
  std::uint64_t timed_out() const { return reader->counters().transfers.value().timed_out; }

  Witness member{bus, telemetry_id(node)};
  Recorder datagrams;
  std::unique_ptr<Carrier> reader = host();
  std::vector<CanFrame> frames;
  std::vector<Sending> sendings;
};

TEST_F(CanBusTimes, AreTheArrivalTimesOfFramesThatAreReadLate) {
  constexpr std::chrono::milliseconds gap{25};  // six gaps are longer than N_Cr
  ASSERT_EQ(frames.size(), 7U);
  bool in_time = false;
  for (int run = 0; run < most_runs && !in_time; ++run) {
    member.frames.clear();
    member.came_us.clear();
    sendings.clear();
    datagrams.datagrams.clear();
    send(1, gap);
    read_all();
    send(frames.size() - 1, gap);
    read_all();
    in_time = true;  // false after a standstill of this machine
    for (std::size_t n = 1; n < frames.size(); ++n) {
      if (most_gap_us(n) > n_cr / std::chrono::microseconds(1)) in_time = false;
    }
  }
  ASSERT_TRUE(in_time) << "this computer stood still in every run";
  for (std::size_t n = 2; n < frames.size(); ++n) {  // frames that were read together
    const std::uint32_t gap_us = member.came_us[n] - member.came_us[n - 1];
    EXPECT_GE(gap_us + 1, least_gap_us(n)) << n;
    EXPECT_LE(gap_us, most_gap_us(n) + 1) << n;
  }
  EXPECT_EQ(datagrams.datagrams.size(), 1U) << timed_out() << " timed out";
}

TEST_F(CanBusTimes, ShowAPauseOfTheSenderInFramesReadTogether) {
  send(2, {});
  send(1, n_cr * 3 / 2);
  send(frames.size() - 3, {});
  read_all();
  EXPECT_TRUE(datagrams.datagrams.empty());
  EXPECT_EQ(timed_out(), 1U);
}

// --- frames that are lost because no program reads

// Sends more frames than a socket holds. The interface counts the received frames.
class CanBusOverflow : public CanBusTest {
 protected:
  static std::uint64_t came() {
    std::uint64_t count = 0;
    std::ifstream("/sys/class/net/vxcan7/statistics/rx_packets") >> count;
    return count;
  }
  // Returns when all frames in the socket are read. A frame reports how many frames were lost
  // before it.
  void flood() {
    const std::size_t before = member.frames.size();
    for (int i = 0; i < 3000; ++i) remote.send(data(1));
    ASSERT_TRUE(run_until([&] { return member.frames.size() > before; }));
    remote.send(data(2));
    ASSERT_TRUE(run_until([&] { return member.frames.back() == 2; }));
  }
  std::uint64_t missed() const { return came() - came_before - member.frames.size(); }

  Witness member{bus};
  const std::uint64_t came_before = came();
};

TEST_F(CanBusOverflow, IsCountedExactlyEvenIfTheInterfaceWasDown) {
  flood();
  const std::uint64_t first = missed();
  EXPECT_GT(first, 0U);
  EXPECT_EQ(bus->overflows(), first);
  ASSERT_EQ(0, std::system("ip link set vxcan7 down"));
  ASSERT_TRUE(run_until([&] { return !bus->up(); }));
  ASSERT_EQ(0, std::system("ip link set vxcan7 up"));
  ASSERT_TRUE(run_until([&] { return bus->up(); }));
  EXPECT_EQ(bus->overflows(), first);
  flood();
  EXPECT_GT(missed(), first);
  EXPECT_EQ(bus->overflows(), missed());
}

}  // namespace
}  // namespace r4::test
