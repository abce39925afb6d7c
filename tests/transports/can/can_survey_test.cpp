// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/can/can_survey.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "protocol/messages/message.hpp"
#include "r4link/messages/datagram_writer.hpp"
#include "transports/framing/can/can_node.hpp"

namespace r4 {
namespace {

constexpr CanBitRate one_mbit{1000000, 0};

// The board's end of a bus, with a survey.
struct Bus {
  explicit Bus(std::uint8_t node = 3) : board(CanEnd::board, node, false) {
    survey.on_datagram([this](std::uint8_t from, const Datagram& datagram) {
      heard.push_back(std::to_string(from) + " " +
                      std::string(datagram.bytes().data(), datagram.bytes().size()));
    });
    survey.on_stop([this] { ++stops; });
  }

  // Sends a datagram of the board. The survey does not receive frame `without`.
  void say(Text datagram, int without = -1) {
    ASSERT_TRUE(board.begin(datagram, now_us));
    CanFrame frame{};
    for (int i = 0; board.offer(now_us, frame); ++i) {
      board.frame_sent(now_us);
      now_us += 130;
      if (i != without) survey.on_frame(frame, now_us);
    }
    now_us += 10000;
  }
  void state(std::uint32_t pnum, int without = -1) {
    DatagramWriter writer(bytes, sizeof bytes);
    writer.field("AIN24").value(2428U);
    writer.field("SAFE").value(0U);
    say(writer.finish(pnum, 5000 + pnum), without);
  }
  void heartbeat(std::uint32_t pnum, std::uint32_t t_ms, SafeReason reason) {
    say(write_board_heartbeat(bytes, sizeof bytes, pnum, t_ms, reason));
  }

  char bytes[max_datagram];
  CanNode board;
  CanSurvey survey{one_mbit};
  std::vector<std::string> heard;
  int stops = 0;
  std::uint32_t now_us = 0xFFFF0000;  // wraps during the test
};

TEST(CanSurvey, DistinguishesR4IdsFromThoseOfAnotherProtocol) {
  Bus bus;
  CanFrame frame{};
  frame.size = 8;
  for (const std::uint32_t id : {command_id(3), reply_id(4), telemetry_id(4), watch_id(4)}) {
    frame.id = id;
    for (std::uint8_t first = 0; first < 0x40; ++first) {
      frame.data[0] = first;
      bus.survey.on_frame(frame, bus.now_us += 1000);
    }
    EXPECT_FALSE(bus.survey.is_r4(id)) << id;
  }
  bus.state(1);
  EXPECT_TRUE(bus.survey.is_r4(telemetry_id(3)));
  EXPECT_FALSE(bus.survey.is_r4(command_id(3))) << "no host has sent anything";
  EXPECT_FALSE(bus.survey.is_r4(0x123));
  EXPECT_TRUE(bus.survey.is_r4(emergency_stop_id));
}

TEST(CanSurvey, ABoardWithAKeyAndWithoutAHostIsNotConnected) {
  Bus bus;
  bus.say(write_board_heartbeat(bus.bytes, sizeof bus.bytes, 0, 5000, SafeReason::link,
                                "00112233aabbccdd"));
  EXPECT_EQ(bus.survey.board(3).heartbeats, 1U);
  EXPECT_FALSE(bus.survey.board(3).connected);
}

TEST(CanSurvey, HearsEveryDatagramOfABoard) {
  Bus bus;
  for (std::uint32_t pnum = 10; pnum < 30; ++pnum) bus.state(pnum);
  ASSERT_EQ(bus.heard.size(), 20U);
  EXPECT_EQ(bus.heard[0].substr(0, 13), "3 AIN24:2428;");
  const HeardNode& board = bus.survey.board(3);
  EXPECT_EQ(board.states, 20U);
  EXPECT_EQ(board.lost, 0U);
  EXPECT_EQ(board.damaged, 0U);
  EXPECT_EQ(board.pnum, 29U);
  EXPECT_TRUE(board.connected);
  EXPECT_FALSE(bus.survey.board(4).heard());
}

TEST(CanSurvey, HearsThePackedForm) {
  Bus bus;
  bus.board.use_packed_form(true);
  bus.state(7);
  EXPECT_EQ(bus.survey.board(3).states, 1U);
  EXPECT_EQ(bus.heard.at(0).substr(0, 8), "3 AIN24:");
}

TEST(CanSurvey, CountsLostDatagrams) {
  Bus bus;
  bus.state(10);
  bus.state(11, 2);  // one frame is lost
  bus.state(14);
  bus.state(15);
  EXPECT_EQ(bus.survey.board(3).states, 3U);
  EXPECT_EQ(bus.survey.board(3).lost, 3U);
  EXPECT_EQ(bus.survey.board(3).damaged, 1U);
}

TEST(CanSurvey, ABoardWithoutAHostIsNotConnected) {
  Bus bus;
  bus.heartbeat(0, 0, SafeReason::none);
  EXPECT_TRUE(bus.survey.board(3).heard());
  EXPECT_FALSE(bus.survey.board(3).connected);
  bus.heartbeat(1, 700, SafeReason::none);
  EXPECT_TRUE(bus.survey.board(3).connected);
  bus.heartbeat(0, 0, SafeReason::none);  // the board has restarted
  bus.heartbeat(1, 90, SafeReason::none);
  EXPECT_EQ(bus.survey.board(3).lost, 0U);
}

TEST(CanSurvey, StatesForAWatcherDoNotProveAHost) {
  Bus bus;
  bus.heartbeat(0, 0, SafeReason::none);
  bus.state(7);
  EXPECT_EQ(bus.survey.board(3).states, 1U);
  EXPECT_FALSE(bus.survey.board(3).connected);
}

TEST(CanSurvey, ReportsWhyABoardIsSafe) {
  Bus bus;
  bus.heartbeat(5, 900, SafeReason::stop);
  EXPECT_EQ(bus.survey.board(3).reason, SafeReason::stop);
  CanFrame frame{};
  frame.id = went_safe_id(3);
  frame.size = 1;
  frame.data[0] = 1;
  bus.survey.on_frame(frame, bus.now_us);
  EXPECT_EQ(bus.survey.board(3).reason, SafeReason::link);
  frame.data[0] = 99;
  bus.survey.on_frame(frame, bus.now_us);
  EXPECT_EQ(bus.survey.board(3).reason, SafeReason::fault);
  frame.size = 0;  // an empty frame has no reason
  bus.survey.on_frame(frame, bus.now_us);
  EXPECT_EQ(bus.survey.board(3).reason, SafeReason::fault);
}

TEST(CanSurvey, ReportsAnEmergencyStop) {
  Bus bus;
  CanFrame frame{};
  frame.id = emergency_stop_id;
  bus.survey.on_frame(frame, 0);
  EXPECT_EQ(bus.stops, 1);
}

TEST(CanSurvey, CountsTheBitsOfEveryId) {
  Bus bus;
  CanFrame frame{};
  frame.id = 0x555;
  frame.size = 8;
  for (std::uint8_t& byte : frame.data) byte = 0x55;
  for (int i = 0; i < 3; ++i) bus.survey.on_frame(frame, 0);
  frame.extended = true;
  frame.id = 0x12345678;
  bus.survey.on_frame(frame, 0);
  const auto& traffic = bus.survey.traffic();
  ASSERT_EQ(traffic.size(), 2U);
  frame.extended = false;
  frame.id = 0x555;
  EXPECT_EQ(traffic.at(0x555).frames, 3U);
  EXPECT_EQ(traffic.at(0x555).bits, 3U * total(can_bits(frame)));
  EXPECT_EQ(traffic.at(0x555).busy_ns, 3U * time_ns(frame, one_mbit));
  EXPECT_EQ(traffic.at(CanSurvey::extended_ids).frames, 1U);
  EXPECT_EQ(bus.survey.busy_ns(),
            traffic.at(0x555).busy_ns + traffic.at(CanSurvey::extended_ids).busy_ns);
}

TEST(CanSurvey, CountsGarbageAndThenReadsStatesAgain) {
  Bus bus;
  CanFrame frame{};
  frame.id = telemetry_id(3);
  frame.size = 8;
  for (int byte = 0; byte < 256; ++byte) {
    for (std::uint8_t& each : frame.data) each = static_cast<std::uint8_t>(byte);
    bus.survey.on_frame(frame, bus.now_us += 100);
  }
  EXPECT_TRUE(bus.heard.empty());
  EXPECT_GT(bus.survey.board(3).damaged, 0U);
  bus.now_us += 20000;
  bus.state(1);
  EXPECT_EQ(bus.survey.board(3).states, 1U);
}

}  // namespace
}  // namespace r4
