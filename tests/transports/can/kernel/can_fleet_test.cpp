// SPDX-License-Identifier: GPL-3.0-or-later
// A fleet on one CAN bus: one frame stops all boards of the fleet.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "r4link/can/can_ids.hpp"
#include "r4link/fleet.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/board_in_a_thread.hpp"
#include "tests/transports/can/kernel/raw_can.hpp"

namespace r4::test {
namespace {

// A board refuses a late command, so on a busy machine the test repeats the command.
void send_to_all(Fleet& fleet, const std::string& command) {
  for (int most = 20; most > 0; --most) {
    if (fleet.send(command, std::chrono::seconds{5}).all_confirmed()) return;
  }
  ADD_FAILURE() << command;
}

TEST(CanFleet, IsStoppedByOneFrameAndEachBoardConfirmsIt) {
  std::vector<std::unique_ptr<BoardInAThread>> boards;
  for (int node = 20; node < 24; ++node) {
    boards.push_back(std::make_unique<BoardInAThread>("can://vcan0?node=" + std::to_string(node)));
  }
  Fleet fleet({"can://vcan0?node=20-23"}, at_will());
  ASSERT_EQ(fleet.wait_active(std::chrono::seconds{10}), Fleet::Boards{});
  send_to_all(fleet, "O:500,1,1");

  RawCan bare(emergency_stop_id);
  EXPECT_TRUE(fleet.stop(std::chrono::seconds{5}).all_confirmed());
  std::uint32_t quiet_us = clock_us() + 300000;  // a stop is repeated for 200 ms
  int frames = 0;
  CanFrame frame;
  while (bare.receive(frame, quiet_us)) ++frames;
  EXPECT_EQ(frames, 1) << "one frame for all four boards";
  for (const auto& board : boards) {
    EXPECT_TRUE(board->wait_for(firmware::BoardState::safe, SafeReason::stop));
    std::vector<std::string> stops = board->executed();
    std::erase_if(stops, [](const std::string& each) { return !each.starts_with("E:STOP"); });
    EXPECT_GE(stops.size(), 2U) << "the bare frame, and the datagram with a packet number";
    EXPECT_LE(stops.size(), 25U) << "all boards together repeat it every 20 ms";
  }
  fleet.send(Command::clear(), std::chrono::seconds{5}).require();
  send_to_all(fleet, "O:1,1,1");
}

// The other host keeps its board; the other boards are free.
TEST(CanFleet, AHostOfOneBoardDoesNotBlockTheOtherBoards) {
  std::vector<std::unique_ptr<BoardInAThread>> boards;
  for (int node = 24; node < 28; ++node) {
    boards.push_back(std::make_unique<BoardInAThread>("can://vcan0?node=" + std::to_string(node)));
  }
  std::atomic<bool> drives{true};
  std::thread other([&] {
    RawCan raw(went_safe_id(27));
    CanFrame heartbeat{};  // one frame whose text has no meaning
    heartbeat.id = command_id(27);
    heartbeat.size = 3;
    heartbeat.data[0] = 2;
    CanFrame ignored;
    while (drives) {
      raw.send(heartbeat);
      raw.receive(ignored, clock_us() + 20000);
    }
  });
  {
    Fleet fleet({"can://vcan0?node=24-27"}, at_will());
    for (const std::size_t board : {0U, 1U, 2U}) fleet[board].wait_active(std::chrono::seconds{5});
    EXPECT_EQ(fleet.wait_active(std::chrono::milliseconds{0}), Fleet::Boards{3});
  }
  drives = false;
  other.join();
}

}  // namespace
}  // namespace r4::test
