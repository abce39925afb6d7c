// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/r4/web/server/client_queue.hpp"

#include <gtest/gtest.h>

namespace r4::tool::web {
namespace {

using namespace std::chrono_literals;
using Kind = Outgoing::Kind;

Outgoing message_of(std::string text, Kind kind) {
  return {std::make_shared<const std::string>(std::move(text)), "", kind};
}

std::string popped(ClientQueue& queue) {
  const std::optional<Outgoing> next = queue.pop();
  return next ? *next->body : "none";
}

constexpr ClientQueue::Time begin{};

TEST(WebClientQueue, HandsOutInTheOrderOfArrival) {
  ClientQueue queue;
  EXPECT_TRUE(queue.push(message_of("state 1", Kind::state), begin));
  EXPECT_TRUE(queue.push(message_of("event", Kind::other), begin));
  EXPECT_TRUE(queue.push(message_of("state 2", Kind::state), begin));
  EXPECT_EQ(popped(queue), "state 1");
  EXPECT_EQ(popped(queue), "event");
  EXPECT_EQ(popped(queue), "state 2");
  EXPECT_EQ(popped(queue), "none");
  EXPECT_EQ(queue.bytes(), 0U);
}

TEST(WebClientQueue, DropsOldStatesAndReportsHowMany) {
  ClientQueue queue;
  for (int i = 0; i < 10; ++i) {
    EXPECT_TRUE(
        queue.push(message_of("state " + std::to_string(i), Kind::state), begin + i * 100ms));
  }
  EXPECT_EQ(popped(queue), "state 7");  // 200 ms older than the newest state
  EXPECT_EQ(queue.take_lost(), 7U);
  EXPECT_EQ(queue.take_lost(), 0U);
}

TEST(WebClientQueue, DropsOnlyStates) {
  ClientQueue queue;
  EXPECT_TRUE(queue.push(message_of("stopped", Kind::other), begin));
  EXPECT_TRUE(queue.push(message_of("state", Kind::state), begin + 1h));
  EXPECT_EQ(popped(queue), "stopped");
}

TEST(WebClientQueue, IsBoundedInBytes) {
  ClientQueue queue;
  const std::string large(ClientQueue::most_state_bytes / 4, 'x');
  for (int i = 0; i < 100; ++i) {
    EXPECT_TRUE(queue.push(message_of(large, Kind::state), begin));
    EXPECT_LE(queue.bytes(), ClientQueue::most_state_bytes);
  }
  EXPECT_EQ(queue.take_lost(), 96U);
  EXPECT_TRUE(queue.push(
      message_of(std::string(ClientQueue::most_state_bytes + 1, 'x'), Kind::state), begin));
  EXPECT_EQ(queue.take_lost(), 5U);
}

TEST(WebClientQueue, ReportsThatThereIsNoRoomForAnEvent) {
  ClientQueue queue;
  const std::string half(ClientQueue::most_other_bytes / 2, 'x');
  EXPECT_TRUE(queue.push(message_of(half, Kind::other), begin));
  EXPECT_TRUE(queue.push(message_of(half, Kind::other), begin));
  EXPECT_FALSE(queue.push(message_of("x", Kind::other), begin));
}

}  // namespace
}  // namespace r4::tool::web
