// SPDX-License-Identifier: GPL-3.0-or-later
// The test cases follow the clauses of ISO 15765-2:2016.
#include "transports/framing/can/isotp_sender.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/transports/framing/can/isotp_sender_fixture.hpp"

namespace r4::test {
namespace {

// 9.6.2.1, 10.4.2: a short datagram is one frame, in the shortest form.
TEST(IsotpSender, SendsADatagramThatFitsAsASingleFrame) {
  IsotpSenderOptions padded = classic();
  padded.channel.padding = true;
  IsotpSenderOptions zeros = padded;
  zeros.channel.padding_byte = 0;
  const struct {
    IsotpSenderOptions options;
    std::size_t size;
    std::string frame;
  } cases[] = {
      {classic(), 1, "01 01"},
      {classic(), 7, "07 01 02 03 04 05 06 07"},
      {padded, 1, "01 01 CC CC CC CC CC CC"},
      {zeros, 5, "05 01 02 03 04 05 00 00"},
      {fd(64), 7, "07 01 02 03 04 05 06 07"},
      {fd(64), 8, "00 08 " + counting(8) + " CC CC"},
      {fd(64), 10, "00 0A " + counting(10)},
      {fd(12), 10, "00 0A " + counting(10)},
      {fd(64), 62, "00 3E " + counting(62)},
      {fd(48), 33, "00 21 " + counting(33) + " CC CC CC CC CC CC CC CC CC CC CC CC CC"},
  };
  for (const auto& c : cases) {
    Sender sender(c.options);
    ASSERT_TRUE(sender.start(counted(c.size)));
    EXPECT_EQ(sender.take(), Frames{c.frame});
    EXPECT_FALSE(sender.busy());
    EXPECT_EQ(sender.error(), IsotpError::none);
    EXPECT_EQ(sender.counters().datagrams, 1U);
  }
}

// 9.6.3.1: 12 bits of length, the escape for more than 4095.
TEST(IsotpSender, AFirstFrameHoldsTheLength) {
  const struct {
    IsotpSenderOptions options;
    std::size_t size;
    std::string frame;
  } cases[] = {
      {classic(), 8, "10 08 01 02 03 04 05 06"},
      {classic(), 4095, "1F FF 01 02 03 04 05 06"},
      {classic(), 4096, "10 00 00 00 10 00 01 02"},
      {classic(), 0x12345, "10 00 00 01 23 45 01 02"},
      {fd(12), 11, "10 0B " + counting(10)},
      {fd(64), 63, "10 3F " + counting(62)},
      {fd(64), 4096, "10 00 00 00 10 00 " + counting(58)},
  };
  for (const auto& c : cases) {
    Sender sender(c.options);
    ASSERT_TRUE(sender.start(counted(c.size)));
    EXPECT_EQ(sender.take(), Frames{c.frame}) << "waits for flow control";
    EXPECT_TRUE(sender.busy());
  }
}

// 9.6.4.3: the first consecutive frame has number 1; 0 follows 15.
TEST(IsotpSender, ConsecutiveFramesCountModuloSixteen) {
  Sender sender(burst());
  ASSERT_TRUE(sender.start(std::string(6 + 7 * 17 + 1, 'x')));
  const Frames frames = sender.take();
  ASSERT_EQ(frames.size(), 19U);
  for (std::size_t i = 1; i < frames.size(); ++i) {
    EXPECT_EQ(frames[i].substr(0, 2), std::string("2") + "0123456789ABCDEF"[i % 16]);
  }
  EXPECT_EQ(frames.back(), "22 78") << "the last frame is as short as possible";
  EXPECT_EQ(sender.counters().frames, 19U);
}

TEST(IsotpSender, RoundsAnInvalidFrameSizeToAValidOne) {
  const struct {
    bool fd;
    std::uint8_t asked, size;
  } cases[] = {{true, 13, 16}, {true, 0, 8}, {true, 255, 64}, {false, 64, 8}, {false, 0, 8}};
  for (const auto& c : cases) {
    IsotpSenderOptions options = burst();
    options.channel.fd = c.fd;
    options.tx_dl = c.asked;
    Sender sender(options);
    sender.start(std::string(100, 'x'));
    CanFrame frame;
    ASSERT_TRUE(sender.offer(0, frame));
    EXPECT_EQ(frame.size, c.size);
    EXPECT_EQ(frame.fd, c.fd);
  }
}

TEST(IsotpSender, RefusesASecondOrEmptyTransfer) {
  Sender sender(classic());
  EXPECT_FALSE(sender.begin(Text(""), 0));
  EXPECT_TRUE(sender.begin(Text("abc"), 0));
  EXPECT_FALSE(sender.begin(Text("def"), 0));
  EXPECT_EQ(sender.take(), Frames{"03 61 62 63"});
  EXPECT_TRUE(sender.start("g"));
  EXPECT_EQ(sender.counters().started, 2U);
}

// A full queue delays frames, but does not lose frames.
TEST(IsotpSender, OffersTheSameFrameUntilItIsAccepted) {
  Sender sender(burst());
  sender.start(counted(20));
  for (const char* expected :
       {"10 14 01 02 03 04 05 06", "21 07 08 09 0A 0B 0C 0D", "22 0E 0F 10 11 12 13 14"}) {
    for (int i = 0; i < 3; ++i) {
      CanFrame frame;
      ASSERT_TRUE(sender.offer(sender.now++, frame));
      EXPECT_EQ(hex_of(frame), expected);
    }
    sender.frame_sent(sender.now);
    sender.frame_sent(sender.now);  // already accepted, so this has no effect
  }
  EXPECT_EQ(sender.counters().datagrams, 1U);
  EXPECT_EQ(sender.counters().frames, 3U);
}

// 9.8.2, N_As.
TEST(IsotpSender, TimesOutWhenTheBusDoesNotAcceptAFrame) {
  for (const int accepted : {0, 1, 2}) {
    Sender sender(burst());
    sender.now = 0xFFFFF000;  // the time wraps during the transfer
    sender.start(counted(30));
    CanFrame frame;
    for (int i = 0; i < accepted; ++i) {
      ASSERT_TRUE(sender.offer(sender.now, frame));
      sender.frame_sent(sender.now);
    }
    EXPECT_EQ(sender.poll(sender.now + 1000000), IsotpError::none) << "not offered yet";
    ASSERT_TRUE(sender.offer(sender.now, frame));
    EXPECT_EQ(sender.deadline().at_us, sender.now + 20000);
    EXPECT_TRUE(sender.offer(sender.now + 19999, frame));
    EXPECT_FALSE(sender.offer(sender.now + 20000, frame));
    EXPECT_EQ(sender.error(), IsotpError::send_timeout);
    EXPECT_FALSE(sender.deadline().armed);
    sender.frame_sent(sender.now);
    EXPECT_EQ(sender.counters().frames, static_cast<std::uint32_t>(accepted));
    expect_counters_add_up(sender);
  }
}

// Flow control that arrives in time may be read late. Before this read, the caller may request a
// frame to send.
TEST(IsotpSender, ALatePollDoesNotTimeOutTheTransfer) {
  Sender sender(classic());
  sender.start(counted(10));
  EXPECT_EQ(sender.take().size(), 1U);
  sender.now = 30000;
  EXPECT_TRUE(sender.take().empty());
  sender.now = 19999;  // the time stamp of the flow control
  EXPECT_EQ(sender.answer("30 00 00"), IsotpError::none);
  EXPECT_EQ(sender.take().size(), 1U);
  expect_counters_add_up(sender);
}

// 9.6.5.3: flow control follows the first frame and each block of BS frames except the last block.
TEST(IsotpSender, SendsBlocksOfTheRequestedSize) {
  const struct {
    std::string flow_control;
    std::vector<std::size_t> blocks;  // consecutive frames between two flow controls
  } cases[] = {
      {"30 00 00", {10}},
      {"30 01 00", {1, 1, 1, 1, 1, 1, 1, 1, 1, 1}},
      {"30 03 00", {3, 3, 3, 1}},
      {"30 05 00", {5, 5}},
      {"30 0A 00", {10}},
      {"30 FF 00", {10}},
      {"30 04 00 CC CC CC CC CC", {4, 4, 2}},
  };
  for (const auto& c : cases) {
    Sender sender(classic());
    sender.start(counted(6 + 7 * 10));
    EXPECT_EQ(sender.take().size(), 1U);
    for (const std::size_t block : c.blocks) {
      EXPECT_EQ(sender.answer(c.flow_control), IsotpError::none);
      EXPECT_EQ(sender.take().size(), block) << c.flow_control;
    }
    EXPECT_EQ(sender.counters().datagrams, 1U);
  }
}

// 9.8.2, N_Bs.
TEST(IsotpSender, TimesOutWithoutFlowControl) {
  Sender sender(classic());
  sender.start(counted(30));
  sender.take();
  EXPECT_EQ(sender.deadline().at_us, 20000U);
  EXPECT_EQ(sender.poll(19999), IsotpError::none);
  EXPECT_EQ(sender.poll(20000), IsotpError::flow_control_timeout);
  EXPECT_EQ(sender.error(), IsotpError::flow_control_timeout);
  EXPECT_EQ(sender.counters().flow_control_timeout, 1U);
  expect_counters_add_up(sender);

  sender.start(counted(30));
  sender.take();
  sender.now = 20000;
  EXPECT_EQ(sender.answer("30 00 00"), IsotpError::flow_control_timeout) << "too late";
  EXPECT_FALSE(sender.busy());
  EXPECT_EQ(sender.counters().unexpected_frame, 1U);
}

TEST(IsotpSender, RestartsItsTimeoutWhenItsFrameIsSentLate) {
  Sender sender(classic());
  sender.start(counted(30));
  sender.take();
  sender.wait_anew(15000);
  EXPECT_EQ(sender.deadline().at_us, 35000U);
  sender.now = 34999;
  EXPECT_EQ(sender.answer("30 00 7F"), IsotpError::none);
  sender.wait_anew(40000);
  EXPECT_EQ(sender.deadline().at_us, 34999U) << "no answer is awaited";
  EXPECT_EQ(sender.take().size(), 1U);
}

// 9.7, 9.8.4.
TEST(IsotpSender, WaitsOnRequestALimitedNumberOfTimes) {
  IsotpSenderOptions options = classic();
  options.max_waits = 3;
  Sender sender(options);
  sender.start(counted(6 + 7 * 3));
  sender.take();
  for (int block = 0; block < 2; ++block) {  // the limit is for consecutive waits
    for (int i = 0; i < 3; ++i) {
      sender.now += 19999;
      EXPECT_EQ(sender.answer("31 00 00"), IsotpError::none);
      EXPECT_EQ(sender.take(), Frames{});
      EXPECT_EQ(sender.deadline().at_us, sender.now + 20000);
    }
    sender.now += 19999;
    EXPECT_EQ(sender.answer("30 01 00"), IsotpError::none);
    EXPECT_EQ(sender.take().size(), 1U);
  }
  for (int i = 0; i < 3; ++i) sender.answer("31 00 00");
  EXPECT_TRUE(sender.busy());
  EXPECT_EQ(sender.answer("31 00 00"), IsotpError::too_many_waits);
  EXPECT_FALSE(sender.busy());
  EXPECT_EQ(sender.counters().too_many_waits, 1U);
  expect_counters_add_up(sender);
}

// 9.6.5.1, 9.6.5.2, 9.8.3, 10.4.3.
TEST(IsotpSender, DistinguishesInvalidFlowControl) {
  const struct {
    std::string flow_control;
    IsotpError error;
    bool ends;
    std::uint32_t IsotpSenderCounters::*counter;
  } cases[] = {
      {"32 00 00", IsotpError::overflow, true, &IsotpSenderCounters::overflow},
      {"33 00 00", IsotpError::invalid_flow_status, true,
       &IsotpSenderCounters::invalid_flow_status},
      {"3F 00 00", IsotpError::invalid_flow_status, true,
       &IsotpSenderCounters::invalid_flow_status},
      {"30", IsotpError::malformed, false, &IsotpSenderCounters::malformed},
      {"30 00", IsotpError::malformed, false, &IsotpSenderCounters::malformed},
      {"30 00 00 00 00 00 00 00 00", IsotpError::malformed, false,  // a frame cannot have 9 bytes
       &IsotpSenderCounters::malformed},
  };
  for (const auto& c : cases) {
    Sender sender(classic());
    sender.start(counted(30));
    sender.take();
    EXPECT_EQ(sender.answer(c.flow_control), c.error) << c.flow_control;
    EXPECT_EQ(sender.busy(), !c.ends);
    EXPECT_EQ(sender.counters().*c.counter, 1U);
    EXPECT_EQ(sender.error(), c.ends ? c.error : IsotpError::none);
    expect_counters_add_up(sender);
    if (!c.ends) {
      sender.answer("30 00 00");
      EXPECT_EQ(sender.take().size(), 4U) << "a valid flow control is still obeyed";
    }
  }
}

TEST(IsotpSender, IgnoresUnexpectedFlowControl) {
  Sender sender(classic());
  EXPECT_EQ(sender.answer("30 00 00"), IsotpError::unexpected_frame);
  sender.start(counted(30));
  EXPECT_EQ(sender.answer("32 00 00"), IsotpError::unexpected_frame) << "before the first frame";
  sender.take();
  sender.answer("30 00 7F");
  sender.take();
  EXPECT_EQ(sender.answer("32 00 00"), IsotpError::unexpected_frame) << "between two frames";
  EXPECT_TRUE(sender.busy());
  EXPECT_EQ(sender.deadline().at_us, 127000U) << "the gap is unchanged";
  EXPECT_EQ(sender.counters().unexpected_frame, 3U);
}

TEST(IsotpSender, IgnoresFramesThatAreNotForIt) {
  Sender sender(classic());
  sender.start(counted(30));
  sender.take();
  for (const char* hex : {"", "01 02", "10 08 01 02 03 04 05 06", "21 01", "40"}) {
    EXPECT_EQ(sender.answer(hex), IsotpError::none) << hex;
  }
  CanFrame frame = frame_of(flow_control_id + 1, "30 00 00");
  EXPECT_EQ(sender.on_frame(frame, 0), IsotpError::none);
  frame.id = flow_control_id;
  frame.extended = true;
  EXPECT_EQ(sender.on_frame(frame, 0), IsotpError::none);
  frame.extended = false;
  frame.remote = true;
  EXPECT_EQ(sender.on_frame(frame, 0), IsotpError::none);
  EXPECT_EQ(sender.take(), Frames{});
  EXPECT_EQ(sender.counters().unexpected_frame + sender.counters().malformed, 0U);
}

TEST(IsotpSender, CanBeCancelledAtAnyPoint) {
  for (int frames = 0; frames < 4; ++frames) {
    Sender sender(burst());
    sender.start(counted(30));
    CanFrame frame;
    for (int i = 0; i < frames; ++i) {
      sender.offer(0, frame);
      sender.frame_sent(0);
    }
    sender.offer(0, frame);
    sender.cancel();
    sender.cancel();
    EXPECT_EQ(sender.error(), IsotpError::cancelled);
    EXPECT_EQ(sender.counters().cancelled, 1U);
    expect_counters_add_up(sender);
    sender.start("next");
    EXPECT_EQ(sender.take(), Frames{"04 6E 65 78 74"});
    EXPECT_EQ(sender.error(), IsotpError::none);
  }
}

TEST(IsotpError, HasAnOwnTextForEveryError) {
  std::vector<std::string> texts;
  for (int i = 0; i <= static_cast<int>(IsotpError::malformed) + 1; ++i) {
    const Text text = to_text(static_cast<IsotpError>(i));
    const std::string words(text.data(), text.size());
    EXPECT_FALSE(words.empty());
    for (const std::string& other : texts) EXPECT_NE(words, other);
    texts.push_back(words);
  }
  EXPECT_EQ(texts.back(), "unknown error");
}

}  // namespace
}  // namespace r4::test
