// SPDX-License-Identifier: GPL-3.0-or-later
#include "host/post_box.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <utility>
#include <vector>

namespace r4::test {
namespace {

using namespace std::chrono_literals;

PostBox::Clock::time_point box_now;  // of one test

struct PostBoxTest : testing::Test {
  PostBoxTest() { box_now = {}; }
  void put(const Command& command) { EXPECT_TRUE(box.put(OwnCommand(command))); }
  std::vector<std::string> delivered_after(std::chrono::milliseconds wait) {
    box_now += wait;
    io.restart();
    io.poll();
    return std::exchange(delivered, {});
  }

  asio::io_context io;
  std::vector<std::string> delivered;
  PostBox box{io,
              [this](const CommandOrGroup& what, bool late) {
                delivered.push_back(to_text(first_of(what)) + (late ? " late" : ""));
              },
              [] { return box_now; }};
};

TEST_F(PostBoxTest, ACommandIsLateAfter100Ms) {
  put(Command::osmc(1, Duty(0.1)));
  box_now += PostBox::oldest;
  put(Command::osmc(2, Duty(0.1)));
  EXPECT_EQ(delivered_after(1ms), (std::vector<std::string>{"O:410,1,1 late", "O:410,1,2"}));
}

TEST_F(PostBoxTest, ACommandThatSwitchesAnOutputOffIsNeverLate) {
  put(Command::osmc(1, Duty(0)));
  put(Command::servo(2, Microseconds(0)));
  put(Command::relay(3, false));
  EXPECT_TRUE(box.put(Setpoints{Command::osmc(1, Duty(0)), Command::osmc(2, Duty(0))}));
  EXPECT_TRUE(box.put(Setpoints{Command::osmc(1, Duty(0)), Command::osmc(2, Duty(0.1))}));
  put(Command::relay(3, true));
  EXPECT_EQ(delivered_after(10s),
            (std::vector<std::string>{"O:0,1,1", "S:0,2", "R:3,Off", "O:0,1,1", "O:0,1,1 late",
                                      "R:3,On late"}));
  put(Command::stop());
  EXPECT_EQ(delivered_after(10s), std::vector<std::string>{"E:STOP"});
}

}  // namespace
}  // namespace r4::test
