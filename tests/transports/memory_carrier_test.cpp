// SPDX-License-Identifier: GPL-3.0-or-later
#include "transports/memory_carrier.hpp"

#include <gtest/gtest.h>

#include "recorder.hpp"

namespace r4::test {
namespace {

class MemoryCarrierTest : public testing::Test {
 protected:
  MemoryCarrierTest() {
    auto pair = make_memory_pair(io);
    a = std::move(pair.first);
    b = std::move(pair.second);
  }
  void open_both() {
    a->open(at_a);
    b->open(at_b);
    ASSERT_TRUE(run_until(io, [&] { return at_a.count(Kind::up) == 1; }));
    ASSERT_EQ(at_b.count(Kind::up), 1U);
  }

  asio::io_context io;
  Recorder at_a, at_b;
  std::unique_ptr<Carrier> a, b;
};

TEST_F(MemoryCarrierTest, CarriesBothWaysInOrder) {
  open_both();
  a->send("1", Priority::normal);
  a->send("2", Priority::normal);
  b->send("3", Priority::normal);
  EXPECT_TRUE(at_b.datagrams.empty()) << "must not be delivered within send()";
  ASSERT_TRUE(
      run_until(io, [&] { return at_b.datagrams.size() == 2 && at_a.datagrams.size() == 1; }));
  EXPECT_EQ(at_b.datagrams[0].text, "1");
  EXPECT_EQ(at_b.datagrams[1].text, "2");
  EXPECT_EQ(at_a.datagrams[0].text, "3");
  EXPECT_EQ(at_b.drained, 1);
  EXPECT_EQ(a->counters().tx_datagrams, 2U);
  EXPECT_EQ(b->counters().rx_bytes, 2U);
}

TEST_F(MemoryCarrierTest, AnswersFromTheHandler) {
  open_both();
  at_b.then = [&](const Recorder::Datagram& datagram) {
    b->send("echo " + datagram.text, Priority::normal, datagram.from);
  };
  for (int i = 0; i < 100; ++i) a->send(std::to_string(i), Priority::normal);
  ASSERT_TRUE(run_until(io, [&] { return at_a.datagrams.size() == 100; }));
  EXPECT_EQ(at_a.datagrams.back().text, "echo 99");
}

TEST_F(MemoryCarrierTest, IsDownUntilTheOtherCarrierIsOpen) {
  a->open(at_a);
  EXPECT_FALSE(a->up());
  EXPECT_EQ(a->send("lost", Priority::normal), SendResult::down);
  b->open(at_b);
  EXPECT_TRUE(a->up());
  EXPECT_TRUE(b->up());
  b->close();
  EXPECT_FALSE(a->up());
  b->open(at_b);
  ASSERT_TRUE(run_until(io, [&] { return at_a.count(Kind::up) == 1; }));
  b.reset();
  ASSERT_TRUE(run_until(io, [&] { return at_a.count(Kind::down) == 1; }));
  EXPECT_EQ(a->send("lost", Priority::normal), SendResult::down);
}

TEST_F(MemoryCarrierTest, AStopOvertakesAndTheQueueIsLimited) {
  open_both();
  for (int i = 0; i < 128; ++i) {
    ASSERT_EQ(a->send("normal", Priority::normal), SendResult::sent);
  }
  EXPECT_EQ(a->send("one too many", Priority::normal), SendResult::full);
  for (int i = 0; i < 40; ++i) {
    EXPECT_EQ(a->send("state " + std::to_string(i), Priority::state), SendResult::sent);
  }
  EXPECT_EQ(a->send("stop", Priority::stop), SendResult::sent);
  ASSERT_TRUE(run_until(io, [&] { return at_b.datagrams.size() == 1 + 128 + 32; }));
  EXPECT_EQ(at_b.datagrams.front().text, "stop");
  EXPECT_EQ(at_b.datagrams.back().text, "state 39");
  EXPECT_EQ(a->counters().tx_dropped, 1U + 8U);
}

TEST_F(MemoryCarrierTest, CallsNoHandlerAfterClose) {
  open_both();
  at_b.then = [&](const Recorder::Datagram&) { b->close(); };
  a->send("1", Priority::normal);
  a->send("2", Priority::normal);
  ASSERT_TRUE(run_until(io, [&] { return at_a.count(Kind::down) == 1; }));
  EXPECT_EQ(at_b.datagrams.size(), 1U);
  EXPECT_EQ(at_b.drained, 0);
}

}  // namespace
}  // namespace r4::test
