// SPDX-License-Identifier: GPL-3.0-or-later
#include "transports/send_queue.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace r4 {
namespace {

using std::chrono::milliseconds;

class SendQueueTest : public testing::Test {
 protected:
  SendResult push(std::string_view bytes, Priority priority) {
    return queue.push(bytes, priority, everyone, now);
  }
  std::vector<std::string> drain() {
    std::vector<std::string> all;
    while (const SendQueue::Entry* entry = queue.front(now)) {
      all.emplace_back(entry->text());
      queue.pop();
    }
    return all;
  }

  std::uint64_t dropped = 0;
  SendQueue queue{4, 2, dropped};
  SendQueue::Time now{};
};

using Texts = std::vector<std::string>;

TEST_F(SendQueueTest, SendsStopFirstThenNormalThenState) {
  push("state", Priority::state);
  push("normal 1", Priority::normal);
  push("normal 2", Priority::normal);
  push("stop 1", Priority::stop);
  push("stop 2", Priority::stop);
  EXPECT_EQ(drain(), (Texts{"stop 1", "stop 2", "normal 1", "normal 2", "state"}));
  EXPECT_TRUE(queue.empty());
  EXPECT_EQ(dropped, 0U);
}

TEST_F(SendQueueTest, ReplacesTheOldestState) {
  for (const char* state : {"1", "2", "3", "4"}) {
    EXPECT_EQ(push(state, Priority::state), SendResult::sent);
  }
  EXPECT_EQ(drain(), (Texts{"3", "4"}));
  EXPECT_EQ(dropped, 2U);
}

TEST_F(SendQueueTest, RefusesANormalDatagramWhenFull) {
  for (const char* text : {"1", "2", "3", "4"}) push(text, Priority::normal);
  EXPECT_EQ(push("5", Priority::normal), SendResult::full);
  EXPECT_EQ(push("stop", Priority::stop), SendResult::sent);
  EXPECT_EQ(push("state", Priority::state), SendResult::sent);
  EXPECT_EQ(drain(), (Texts{"stop", "1", "2", "3", "4", "state"}));
  EXPECT_EQ(dropped, 1U);
}

TEST_F(SendQueueTest, NeverRefusesAStop) {
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ(push("stop " + std::to_string(i), Priority::stop), SendResult::sent);
  }
  const Texts left = drain();
  EXPECT_EQ(left.size(), 8U);
  EXPECT_EQ(left.back(), "stop 99");
}

TEST_F(SendQueueTest, DropsEntriesAfter100MsExceptStops) {
  push("stop", Priority::stop);
  push("old", Priority::normal);
  push("old state", Priority::state);
  now += milliseconds(60);
  push("young", Priority::normal);
  push("young state", Priority::state);
  now += milliseconds(40);
  EXPECT_EQ(drain(), (Texts{"stop", "young", "young state"}));
  EXPECT_EQ(dropped, 2U);
}

TEST_F(SendQueueTest, MakesRoomByDroppingExpiredEntries) {
  for (const char* text : {"1", "2", "3", "4"}) push(text, Priority::normal);
  now += milliseconds(100);
  EXPECT_EQ(push("5", Priority::normal), SendResult::sent);
  EXPECT_EQ(drain(), Texts{"5"});
  EXPECT_EQ(dropped, 4U);
}

TEST_F(SendQueueTest, CountsClearedEntries) {
  push("stop", Priority::stop);
  push("normal", Priority::normal);
  push("state", Priority::state);
  queue.clear();
  EXPECT_TRUE(queue.empty());
  EXPECT_EQ(dropped, 3U);
  EXPECT_EQ(drain(), Texts{});
}

TEST_F(SendQueueTest, KeepsTheLongestDatagramWhole) {
  const std::string longest(max_datagram, 'x');
  push(longest, Priority::normal);
  EXPECT_EQ(drain(), Texts{longest});
}

}  // namespace
}  // namespace r4
