// SPDX-License-Identifier: GPL-3.0-or-later
#include "host/post_box.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <vector>

namespace r4::test {
namespace {

using namespace std::chrono_literals;

PostBox::Clock::time_point box_now;  // of one test

TEST(PostBox, DoesNotDeliverACommandThatWaitedTooLongExceptAStop) {
  box_now = {};
  asio::io_context io;
  std::vector<std::string> delivered;
  PostBox box(
      io,
      [&](const CommandOrGroup& what, bool late) {
        delivered.push_back(to_text(first_of(what)) + (late ? " late" : ""));
      },
      [] { return box_now; });
  const auto put = [&](const Command& command) { EXPECT_TRUE(box.put(OwnCommand(command))); };
  put(Command::osmc(1, Duty(0.1)));
  box_now += PostBox::oldest;
  put(Command::osmc(2, Duty(0.1)));
  box_now += 1ms;
  io.poll();
  EXPECT_EQ(delivered, (std::vector<std::string>{"O:410,1,1 late", "O:410,1,2"}));

  delivered.clear();
  put(Command::stop());
  box_now += 10s;
  io.restart();
  io.poll();
  EXPECT_EQ(delivered, std::vector<std::string>{"E:STOP"});
}

}  // namespace
}  // namespace r4::test
