// SPDX-License-Identifier: GPL-3.0-or-later
// The gap between frames, requested by flow control or by options. The test cases follow ISO
// 15765-2:2016, 9.6.5.
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "tests/transports/framing/can/isotp_sender_fixture.hpp"
#include "transports/framing/can/isotp_sender.hpp"

namespace r4::test {
namespace {

// 9.6.5.6: each flow control may change block size and gap.
TEST(IsotpSender, ObeysTheNewestFlowControl) {
  Sender sender(classic());
  sender.start(counted(6 + 7 * 6));
  sender.take();
  sender.answer("30 01 7F");
  EXPECT_EQ(sender.take(), Frames{"21 07 08 09 0A 0B 0C 0D"});
  sender.answer("30 02 00");
  EXPECT_EQ(sender.take().size(), 2U) << "at once, without a gap";
  sender.answer("30 00 F5");
  EXPECT_EQ(sender.take().size(), 0U)
      << "the gap also begins at the frame before this flow control";
  EXPECT_EQ(sender.deadline().at_us, 500U);
  sender.now = 500;
  EXPECT_EQ(sender.take().size(), 1U);
  EXPECT_EQ(sender.deadline().at_us, 1000U);
}

// 9.6.5.4, 9.6.5.5: the gap between an accepted frame and the next frame.
TEST(IsotpSender, KeepsTheGapThatTheReceiverAsksFor) {
  for (int stmin = 0; stmin < 256; ++stmin) {
    const std::uint32_t gap_us = stmin <= 0x7F                    ? stmin * 1000U
                                 : stmin >= 0xF1 && stmin <= 0xF9 ? (stmin - 0xF0U) * 100U
                                                                  : 127000U;
    ASSERT_EQ(stmin_to_us(static_cast<std::uint8_t>(stmin)), gap_us);
    Sender sender(classic(), 0xFFFFFF80);
    sender.start(counted(30));
    sender.take();
    char flow_control[16];
    std::snprintf(flow_control, sizeof flow_control, "30 00 %02X", static_cast<unsigned>(stmin));
    sender.answer(flow_control);
    if (gap_us == 0) {
      EXPECT_EQ(sender.take().size(), 4U);
      continue;
    }
    for (int frame = 0; frame < 3; ++frame) {
      EXPECT_EQ(sender.take().size(), 1U) << "the first frame has no gap";
      EXPECT_EQ(sender.deadline().at_us, sender.now + gap_us);
      CanFrame early;
      EXPECT_FALSE(sender.offer(sender.now + gap_us - 1, early));
      sender.now += gap_us;
    }
    EXPECT_EQ(sender.take().size(), 1U);
    EXPECT_FALSE(sender.busy());
  }
}

TEST(IsotpSender, KeepsTheLongerOfItsOwnAndTheRequestedGap) {
  IsotpSenderOptions options = burst();
  options.separation_us = 300;
  Sender sender(options);
  sender.start(counted(20));
  for (int i = 0; i < 3; ++i, sender.now += 300) EXPECT_EQ(sender.take().size(), 1U);
  EXPECT_FALSE(sender.busy());

  options.flow_control = true;
  for (const auto& [flow_control, gap_us] : {std::pair{"30 00 F1", 300U}, {"30 00 F9", 900U}}) {
    Sender slow(options);
    slow.start(counted(20));
    slow.take();
    slow.answer(flow_control);
    EXPECT_EQ(slow.take().size(), 1U);
    EXPECT_EQ(slow.deadline().at_us, gap_us);
  }
}

// 9.6.5.4: STmin is the gap between any two consecutive frames, also if other frames are between
// them.
TEST(IsotpSender, KeepsTheGapBetweenTwoBlocks) {
  const struct {
    std::uint32_t answered_us;  // after the last frame
    std::uint32_t due_us;
  } cases[] = {{0, 100000}, {1000, 100000}, {99999, 100000}, {100000, 100000}, {150000, 150000}};
  for (const auto& c : cases) {
    IsotpSenderOptions options = classic();
    options.n_bs_us = 200000;
    Sender sender(options, 0xFFFFFF80);
    sender.start(counted(6 + 7 * 20));  // the sequence number is 1 again
    sender.take();
    for (int frame = 0; frame < 20; ++frame) {
      const std::uint32_t before = sender.now;
      if (frame != 0) sender.now += c.answered_us;
      EXPECT_EQ(sender.answer("30 01 64"), IsotpError::none);
      if (frame != 0) {
        EXPECT_EQ(sender.deadline().at_us, before + c.due_us) << frame;
        CanFrame early;
        EXPECT_EQ(sender.offer(sender.now, early), c.answered_us == c.due_us) << frame;
        sender.now = before + c.due_us;
      }
      EXPECT_EQ(sender.take().size(), 1U) << "the first frame has no gap";
    }
    EXPECT_FALSE(sender.busy());
  }
}

// The time stamps of received frames may be ahead of our clock. So an answer may have an earlier
// stamp than the frame that it answers.
TEST(IsotpSender, KeepsTheGapAfterFlowControlWithAnEarlyTimeStamp) {
  Sender sender(classic(), 1000);
  sender.start(counted(30));
  sender.take();
  sender.answer("30 01 64");
  sender.take();
  sender.now -= 50;
  sender.answer("30 01 64");
  EXPECT_EQ(sender.deadline().at_us, 101000U);
}

// A gap that begins before its frame is on the bus would be too short on the wire.
TEST(IsotpSender, RestartsTheGapWhenItsFrameIsSentLate) {
  Sender sender(classic());
  sender.start(counted(40));
  sender.take();
  sender.wait_anew(500);  // the first frame
  sender.now = 600;
  sender.answer("30 02 64");
  EXPECT_EQ(sender.take().size(), 1U) << "the first frame has no gap";
  sender.wait_anew(90000);
  EXPECT_EQ(sender.deadline().at_us, 190000U);
  sender.now = 190000;
  EXPECT_EQ(sender.take().size(), 1U);
  sender.wait_anew(200000);  // the last frame of its block
  sender.now = 201000;
  sender.answer("30 00 64");
  EXPECT_EQ(sender.deadline().at_us, 300000U);
}

TEST(IsotpSender, RoundsAGapUpToTheNextStMin) {
  const struct {
    std::uint32_t us;
    std::uint8_t stmin;
  } cases[] = {{0, 0},        {1, 0xF1},     {100, 0xF1}, {101, 0xF2},   {900, 0xF9},
               {901, 1},      {1000, 1},     {1001, 2},   {126000, 126}, {126001, 127},
               {127000, 127}, {127001, 127}, {~0U, 127}};
  for (const auto& c : cases) EXPECT_EQ(stmin_from_us(c.us), c.stmin) << c.us;
}

}  // namespace
}  // namespace r4::test
