// SPDX-License-Identifier: GPL-3.0-or-later
// read_recording(): a recording for a program of C++.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "r4link/board.hpp"
#include "tests/support/at_will.hpp"

namespace r4::test {
namespace {

struct VisitorOfAll final : RecordingVisitor {
  void on_path(int path, const std::string& url, const std::string& name) override {
    paths.push_back(std::to_string(path) + " " + url + " " + name);
  }
  void on_state(int path, Time at, const State& state) override {
    EXPECT_EQ(path, 1);
    EXPECT_GT(at, last);
    last = at;
    pwm.push_back(state.osmc(1).pwm);
  }
  void on_datagram(int, Time, bool from_board, std::string_view) override {
    ++(from_board ? from : to);
  }
  void on_event(int path, Time, std::string_view words) override {
    events.push_back(std::to_string(path) + " " + std::string(words));
  }
  void on_damage(const std::string& words) override { ADD_FAILURE() << words; }

  std::vector<std::string> paths, events;
  std::vector<int> pwm;
  Time last{0};
  int from = 0, to = 0;
};

TEST(ReadRecording, VisitsAllThatWasRecorded) {
  const std::string path = testing::TempDir() + "r4-read-" + std::to_string(::getpid());
  Statistics live;
  {
    Board board("sim:", at_will());
    board.record(path);
    board.wait_active();
    board.osmc(1).set_pwm(358, Direction::forward);
    board.next_state();
    board.osmc(1).set_pwm(10, Direction::forward);
    live = board.statistics();
  }
  VisitorOfAll visitor;
  read_recording(path, visitor);
  std::filesystem::remove(path);
  EXPECT_EQ(visitor.paths.back(), "1 sim: sim-1");
  EXPECT_NE(std::find(visitor.pwm.begin(), visitor.pwm.end(), 358), visitor.pwm.end());
  EXPECT_EQ(visitor.pwm.back(), 10);
  EXPECT_GE(visitor.from + 10, static_cast<int>(live.received)) << "but what came before record()";
  EXPECT_GT(visitor.to, 2);
  EXPECT_EQ(visitor.events.back(), "0 end");
}

}  // namespace
}  // namespace r4::test
