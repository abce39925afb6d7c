// SPDX-License-Identifier: GPL-3.0-or-later
#include "transports/framing/can/can_node.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "tests/support/datagrams.hpp"

namespace r4 {
namespace {

using test::str;
using test::with_crc;

// A board and a host on a bus in virtual time that can lose frames.
struct NodeBus {
  explicit NodeBus(bool fd = false, std::uint8_t host_node = 3)
      : board(CanEnd::board, 3, fd), host(CanEnd::host, host_node, fd) {}

  // Moves frames until neither end has a frame to send.
  void settle() {
    CanFrame frame{};
    for (bool any = true; any;) {
      any = false;
      while (board.offer(now_us, frame)) {
        board.frame_sent(now_us);
        carry(frame, host, at_host);
        any = true;
      }
      while (host.offer(now_us, frame)) {
        host.frame_sent(now_us);
        carry(frame, board, at_board);
        any = true;
      }
      now_us += 100;
    }
  }
  void carry(const CanFrame& frame, CanNode& to, std::vector<std::string>& heard) {
    ids.push_back(frame.id);
    if (ids.size() == lose) return;
    const Text datagram = to.on_frame(frame, now_us);
    if (!datagram.empty()) heard.push_back(str(datagram));
  }

  CanNode board, host;
  std::uint32_t now_us = 0xFFFFFF00;  // wraps during the test
  std::vector<std::string> at_board, at_host;
  std::vector<std::uint32_t> ids;
  std::size_t lose = 0;  // number of the lost frame, from 1; 0: no frame is lost
};

const std::string state_line = with_crc("AIN24:23.5;AIN12:12.1;OSMC1:358,1;PNum:77;T:81234;");
const std::string command_line = with_crc("O:358,1,1;PNum:2147483650;T:81234;");
const std::string answer_line = with_crc("N:2147483650,RANGE;PNum:78;T:81240;");
const std::string heartbeat_line = with_crc("H:R4-ROS2;PNum:79;T:81300;");

TEST(CanNodeStop, IsAnEmergencyFrameWithOrWithoutANumber) {
  CanNode board(CanEnd::board, 3, false);
  CanNode host(CanEnd::host, 3, false);
  CanFrame frame{};
  frame.id = emergency_stop_id;
  EXPECT_EQ(str(board.on_frame(frame, 0)), with_crc("E:STOP;"));
  frame.extended = true;
  frame.id = numbered_stop_id(2147484650U);
  EXPECT_EQ(str(board.on_frame(frame, 0)), with_crc("E:STOP;STOP:1002;"));
  EXPECT_EQ(board.counters().stops, 2U);
  EXPECT_TRUE(host.on_frame(frame, 0).empty());
  for (const std::uint32_t other : {0x010U, 0x011U << 18, 0x00FU << 18 | 0x3FFFFU, 0x180U << 18}) {
    frame.id = other;
    EXPECT_TRUE(board.on_frame(frame, 0).empty()) << other;
  }
  frame.id = numbered_stop_id(5);
  frame.remote = true;
  EXPECT_TRUE(board.on_frame(frame, 0).empty()) << "a remote request is not a stop";
}

TEST(CanNodeWatch, AsksForStatesWithOneWatchFrame) {
  NodeBus bus;
  bus.host.ask_for_states();
  bus.settle();
  EXPECT_EQ(bus.ids, std::vector<std::uint32_t>{watch_id(3)});
  EXPECT_EQ(bus.at_board, std::vector<std::string>{with_crc("W:5;")});
  NodeBus other(false, 4);
  other.host.ask_for_states();
  other.settle();
  EXPECT_TRUE(other.at_board.empty()) << "the host watches another board";
}

class CanNodeForms : public testing::TestWithParam<std::pair<bool, bool>> {};

TEST_P(CanNodeForms, CarryEveryDatagramUnchanged) {
  const auto [fd, packed] = GetParam();
  NodeBus bus(fd);
  bus.board.use_packed_form(packed);
  bus.host.use_packed_form(packed);
  for (const std::string& line : {state_line, heartbeat_line, answer_line}) {
    EXPECT_TRUE(bus.board.begin(line, bus.now_us));
    bus.settle();
  }
  EXPECT_TRUE(bus.host.begin(command_line, bus.now_us));
  bus.settle();
  EXPECT_EQ(bus.at_host, (std::vector<std::string>{state_line, heartbeat_line, answer_line}));
  EXPECT_EQ(bus.at_board, (std::vector<std::string>{command_line}));
  EXPECT_EQ(bus.host.counters().unpacked, packed ? 3U : 0U);
}

INSTANTIATE_TEST_SUITE_P(ClassicAndFd, CanNodeForms,
                         testing::Values(std::pair(false, false), std::pair(false, true),
                                         std::pair(true, false), std::pair(true, true)));

// A board uses the form of the newest datagram that it received from its host.
TEST(CanNode, ABoardAnswersATextHostInText) {
  NodeBus bus;
  bus.board.use_packed_form(true);
  const auto packed_at_host = [&](const std::string& line) {
    const std::uint32_t before = bus.host.counters().unpacked;
    EXPECT_TRUE(bus.board.begin(line, bus.now_us));
    bus.settle();
    EXPECT_EQ(bus.at_host.back(), line);
    return bus.host.counters().unpacked != before;
  };
  const auto host_says = [&](bool packed) {
    bus.host.use_packed_form(packed);
    EXPECT_TRUE(bus.host.begin(command_line, bus.now_us));
    bus.settle();
  };
  EXPECT_TRUE(packed_at_host(state_line)) << "no host has sent anything yet";
  host_says(false);
  for (const std::string& line : {state_line, heartbeat_line, answer_line}) {
    EXPECT_FALSE(packed_at_host(line)) << line;
  }
  host_says(true);
  for (const std::string& line : {state_line, heartbeat_line, answer_line}) {
    EXPECT_TRUE(packed_at_host(line)) << line;
  }
  bus.board.use_packed_form(false);
  EXPECT_FALSE(packed_at_host(state_line)) << "the setting of the board forbids the packed form";
  bus.board.use_packed_form(true);
  host_says(false);
  const std::uint32_t bad = bus.board.counters().bad_form;
  EXPECT_TRUE(bus.host.begin(std::string("\x80\xff\x12", 3), bus.now_us));
  bus.settle();
  EXPECT_EQ(bus.board.counters().bad_form, bad + 1);
  EXPECT_FALSE(packed_at_host(state_line)) << "garbage is not a packed datagram";
}

TEST(CanNode, AHostMayPackForABoardThatSendsText) {
  NodeBus bus;
  bus.host.use_packed_form(true);
  for (const std::string& line : {state_line, answer_line}) {
    bus.board.begin(line, bus.now_us);
    bus.settle();
  }
  EXPECT_EQ(bus.at_host.size(), 2U);
  bus.host.begin(command_line, bus.now_us);
  bus.settle();
  EXPECT_EQ(bus.at_board, (std::vector<std::string>{command_line}));
  EXPECT_EQ(bus.board.counters().unpacked, 1U);
}

// An emergency frame has no form, and any host may send the frame.
TEST(CanNode, AnEmergencyFrameDoesNotChangeTheForm) {
  NodeBus bus;
  bus.board.use_packed_form(true);
  CanFrame frame{};
  frame.id = emergency_stop_id;
  bus.board.on_frame(frame, bus.now_us);
  bus.board.begin(state_line, bus.now_us);
  bus.settle();
  EXPECT_EQ(bus.host.counters().unpacked, 1U);
}

TEST(CanNode, StatesAndAnswersHaveSeparateIds) {
  NodeBus bus;
  bus.board.begin(state_line, bus.now_us);
  bus.settle();
  ASSERT_FALSE(bus.ids.empty());
  for (const std::uint32_t id : bus.ids) EXPECT_EQ(id, telemetry_id(3));
  bus.ids.clear();
  bus.board.begin(answer_line, bus.now_us);
  bus.settle();
  EXPECT_EQ(bus.ids.front(), reply_id(3));
  EXPECT_EQ(bus.ids[1], command_id(3)) << "the host's flow control";
}

TEST(CanNode, TelemetryGoesOnWhileAnAnswerWaitsForFlowControl) {
  NodeBus bus(false, 4);  // no host answers for node 3
  bus.board.begin(answer_line, bus.now_us);
  bus.settle();
  EXPECT_FALSE(bus.board.idle(CanLane::dialogue));
  EXPECT_TRUE(bus.board.begin(state_line, bus.now_us));
  bus.settle();
  EXPECT_TRUE(bus.board.idle(CanLane::telemetry));
  EXPECT_EQ(bus.board.sent(CanLane::telemetry).datagrams, 1U);
  bus.now_us += 20000;
  bus.board.poll(bus.now_us);
  EXPECT_TRUE(bus.board.idle(CanLane::dialogue));
  EXPECT_EQ(bus.board.sent(CanLane::dialogue).flow_control_timeout, 1U);
}

TEST(CanNode, ALostFrameCostsExactlyOneDatagram) {
  NodeBus whole;
  whole.board.begin(state_line, whole.now_us);
  whole.settle();
  for (std::size_t lost = 1; lost <= whole.ids.size(); ++lost) {
    NodeBus bus;
    bus.lose = lost;
    bus.board.begin(state_line, bus.now_us);
    bus.settle();
    EXPECT_TRUE(bus.at_host.empty());
    bus.board.begin(heartbeat_line, bus.now_us);
    bus.settle();
    EXPECT_EQ(bus.at_host, (std::vector<std::string>{heartbeat_line})) << lost;
  }
}

// The process of a host can have longer delays than a bus.
TEST(CanNode, AcceptsACommandWithFramesLessThan100MsLate) {
  for (const std::uint32_t late_us : {99999U, 100000U}) {
    CanNode board(CanEnd::board, 3, false);
    CanNode host(CanEnd::host, 3, false);
    std::uint32_t now_us = 1000;
    CanFrame frame;
    Text taken;
    ASSERT_TRUE(host.begin(Text(command_line.data(), command_line.size()), now_us));
    for (int frames = 0; host.offer(now_us, frame); ++frames) {
      host.frame_sent(now_us);
      if (frames == 1) now_us += late_us;
      board.poll(now_us);
      taken = board.on_frame(frame, now_us);
      if (board.offer(now_us, frame)) {
        board.frame_sent(now_us);
        host.on_frame(frame, now_us);
      }
    }
    EXPECT_EQ(str(taken), late_us < 100000 ? command_line : std::string()) << late_us;
    EXPECT_EQ(board.received(CanLane::dialogue).consecutive_timeout, late_us < 100000 ? 0U : 1U);
  }
}

TEST(CanNode, AnEmergencyFrameOfAnyContentIsAStop) {
  for (const std::uint8_t size : std::vector<std::uint8_t>{0, 1, 8}) {
    NodeBus bus;
    CanFrame frame{};
    frame.id = emergency_stop_id;
    frame.size = size;
    Datagram datagram;
    const Text stop = bus.board.on_frame(frame, bus.now_us);
    ASSERT_TRUE(read_datagram(stop, datagram)) << str(stop);
    EXPECT_EQ(str(datagram.find("E").values()), "STOP");
    EXPECT_TRUE(bus.host.on_frame(frame, bus.now_us).empty());
    frame.extended = true;
    EXPECT_TRUE(bus.board.on_frame(frame, bus.now_us).empty()) << "another id";
  }
}

TEST(CanNode, ABoardThatGoesSafeReportsItFirstInOneFrame) {
  NodeBus bus;
  const auto beat = [&](const std::string& end) {
    bus.ids.clear();
    bus.board.begin(with_crc("H:R4-ROS2;PNum:79;T:81300;" + end), bus.now_us);
    bus.settle();
    return bus.ids.front();
  };
  EXPECT_EQ(beat(""), telemetry_id(3));
  EXPECT_EQ(beat("SAFE:2;"), went_safe_id(3));
  EXPECT_EQ(beat("SAFE:2;"), telemetry_id(3)) << "the host knows this reason already";
  EXPECT_EQ(beat("SAFE:4;"), went_safe_id(3)) << "another reason";
  EXPECT_EQ(beat(""), telemetry_id(3));
  EXPECT_EQ(beat("SAFE:4;"), went_safe_id(3));
  EXPECT_EQ(bus.at_host.size(), 6U);
}

TEST(CanNode, ABoardWithoutAHostDidNotGoSafe) {
  NodeBus bus;
  for (const char* heartbeat : {"H:R4-ROS2;PNum:0;T:0;", "H:R4-ROS2;PNum:1;T:7;SAFE:1;",
                                "H:R4-ROS2;PNum:0;T:0;", "H:R4-ROS2;PNum:1;T:9;SAFE:1;"}) {
    bus.board.begin(with_crc(heartbeat), bus.now_us);
    bus.settle();
  }
  EXPECT_EQ(std::count(bus.ids.begin(), bus.ids.end(), went_safe_id(3)), 0);
}

TEST(CanNode, AnUnsentSafeReasonIsSentLater) {
  NodeBus bus;
  const std::string safe = with_crc("H:R4-ROS2;PNum:79;T:81300;SAFE:2;");
  bus.board.begin(safe, bus.now_us);
  bus.board.cancel();  // the bus went down before the frame was sent
  bus.board.begin(safe, bus.now_us);
  bus.settle();
  EXPECT_EQ(bus.ids.front(), went_safe_id(3));
  EXPECT_EQ(bus.at_host, (std::vector<std::string>{safe}));
}

TEST(CanNode, RefusesADatagramOnABusyLaneOrOfInvalidLength) {
  NodeBus bus;
  EXPECT_TRUE(bus.board.begin(state_line, bus.now_us));
  EXPECT_FALSE(bus.board.begin(heartbeat_line, bus.now_us));
  EXPECT_TRUE(bus.board.begin(answer_line, bus.now_us));
  EXPECT_FALSE(bus.host.begin(Text(), bus.now_us));
  EXPECT_FALSE(bus.host.begin(std::string(max_datagram + 1, 'a'), bus.now_us));
  bus.board.cancel();
  EXPECT_TRUE(bus.board.idle(CanLane::telemetry));
}

TEST(CanNode, APackedDatagramThatIsDamagedIsDropped) {
  NodeBus bus;
  CanFrame frame{};
  frame.id = telemetry_id(3);
  frame.size = 5;
  frame.data[0] = 4;     // single frame
  frame.data[1] = 0xFF;  // an unknown version
  EXPECT_TRUE(bus.host.on_frame(frame, bus.now_us).empty());
  EXPECT_EQ(bus.host.counters().bad_form, 1U);
}

}  // namespace
}  // namespace r4
