// SPDX-License-Identifier: GPL-3.0-or-later
// The test cases follow the clauses of ISO 15765-2:2016.
#include "transports/framing/can/isotp_receiver.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/transports/framing/can/can_frames.hpp"

namespace r4 {
namespace {

using test::counted;
using test::counting;
using test::frame_of;
using test::hex_of;

using Counter = std::uint32_t IsotpReceiverCounters::*;

constexpr std::uint32_t id = 0x180;
constexpr std::uint32_t flow_control_id = 0x200;
constexpr std::uint32_t n_cr_us = 100000;

IsotpReceiverOptions controlled() {
  IsotpReceiverOptions options;
  options.channel.id = id;
  options.channel.flow_control_id = flow_control_id;
  return options;
}

IsotpReceiverOptions listening() {
  IsotpReceiverOptions options = controlled();
  options.listen_only = true;
  return options;
}

// A receiver with a buffer in virtual time, on a bus that accepts every frame at once.
struct Receiver {
  explicit Receiver(const IsotpReceiverOptions& options, std::uint32_t capacity = 1024)
      : buffer(capacity, '\xEE'), isotp(options, buffer.data(), capacity) {}

  // Passes a frame to the receiver. Appends a complete datagram to `datagrams`.
  IsotpError take(const CanFrame& frame) {
    const IsotpArrival arrival = isotp.on_frame(frame, now);
    if (arrival.datagram) datagrams.emplace_back(isotp.text().data(), isotp.text().size());
    return arrival.error;
  }
  IsotpError take(const std::string& hex) { return take(frame_of(id, hex)); }
  // The flow control that the receiver sends now. Empty if there is no flow control.
  std::string answer() {
    CanFrame frame;
    if (!isotp.offer(now, frame)) return "";
    EXPECT_EQ(frame.id, flow_control_id);
    EXPECT_TRUE(has_valid_size(frame));
    isotp.frame_sent(now);
    return hex_of(frame);
  }
  std::uint32_t counted(Counter counter) const { return isotp.counters().*counter; }

  std::string buffer;
  IsotpReceiver isotp;
  std::vector<std::string> datagrams;
  std::uint32_t now = 0;
};

// Every transfer that began has one end or is under way. Every frame is counted once.
void expect_counters_add_up(const IsotpReceiver& receiver) {
  const IsotpReceiverCounters& c = receiver.counters();
  EXPECT_EQ(c.started, c.datagrams + c.send_timeout + c.consecutive_timeout +
                           c.wrong_sequence_number + c.interrupted + c.too_many_waits +
                           c.cancelled + receiver.busy());
  EXPECT_EQ(c.frames, c.started + c.consecutive + c.wrong_sequence_number + c.overflow +
                          c.unexpected_frame + c.malformed);
}

// 9.6.2.2
TEST(IsotpReceiver, TakesSingleFramesOfEveryForm) {
  const struct {
    std::string frame;
    std::size_t size;  // 0: malformed
  } cases[] = {
      {"01 01", 1},
      {"07 01 02 03 04 05 06 07", 7},
      {"03 01 02 03 CC CC CC CC", 3},
      {"03 01 02 03 00", 3},
      {"00 08 " + counting(8) + " CC CC", 8},
      {"00 3E " + counting(62), 62},
      {"00 01 " + counting(10), 1},
      {"", 0},
      {"00", 0},
      {"00 01 01", 0},                 // only longer frames use the escape
      {"01", 0},                       // no data
      {"07 01 02 03 04 05 06", 0},     // too long by one
      {"08 01 02 03 04 05 06 07", 0},  //
      {"0F 01 02 03 04 05 06 07", 0},  //
      {"00 00 " + counting(10), 0},    // length 0
      {"00 0B " + counting(10), 0},    // too long by one
      {"00 FF " + counting(62), 0},    //
      {"08 " + counting(11), 0},       // a long frame without the escape
      {"00 07 " + counting(7), 0},     // a frame cannot have 9 bytes
      {"40 01", 0},                    // reserved types
      {"F0 01 02 03 04 05 06 07", 0},  //
  };
  for (const auto& c : cases) {
    Receiver receiver(controlled());
    const IsotpError error = receiver.take(c.frame);
    if (c.size == 0) {
      EXPECT_EQ(error, IsotpError::malformed) << c.frame;
      EXPECT_EQ(receiver.counted(&IsotpReceiverCounters::malformed), 1U);
      EXPECT_TRUE(receiver.datagrams.empty());
    } else {
      EXPECT_EQ(error, IsotpError::none) << c.frame;
      EXPECT_EQ(receiver.datagrams, std::vector<std::string>{counted(c.size)});
    }
    EXPECT_EQ(receiver.answer(), "");
    EXPECT_FALSE(receiver.isotp.busy());
    expect_counters_add_up(receiver.isotp);
  }
}

TEST(IsotpReceiver, RefusesAClassicFrameOfMoreThanEightBytes) {
  Receiver receiver(controlled());
  CanFrame frame = frame_of(id, "00 0A " + counting(10));
  frame.fd = false;
  EXPECT_EQ(receiver.take(frame), IsotpError::malformed);
}

// 9.6.3.2
TEST(IsotpReceiver, IgnoresInvalidFirstFrames) {
  const struct {
    std::string frame;
    bool good;
  } cases[] = {
      {"10 08 01 02 03 04 05 06", true},
      {"10 07 01 02 03 04 05 06", false},  // fits a single frame
      {"10 01 01 02 03 04 05 06", false},
      {"10 08 01 02 03 04 05", false},  // a first frame is never short
      {"10 08", false},
      {"10", false},
      {"10 0B " + counting(10), true},
      {"10 0A " + counting(10), false},
      {"10 3F " + counting(62), true},
      {"10 3E " + counting(62), false},
      {"10 00 00 00 10 00 01 02", true},
      {"10 00 00 00 0F FF 01 02", false},  // fits without the escape
      {"10 00 00 00 00 00 01 02", false},
  };
  for (const auto& c : cases) {
    Receiver receiver(controlled(), 5000);
    EXPECT_EQ(receiver.take(c.frame), c.good ? IsotpError::none : IsotpError::malformed) << c.frame;
    EXPECT_EQ(receiver.isotp.busy(), c.good) << c.frame;
    EXPECT_EQ(receiver.answer(), c.good ? "30 00 00" : "") << c.frame;
    expect_counters_add_up(receiver.isotp);
  }
}

TEST(IsotpReceiver, JoinsFramesAndSendsItsConfiguredFlowControl) {
  IsotpReceiverOptions options = controlled();
  options.block_size = 2;
  options.stmin = 0xF3;
  Receiver receiver(options);
  EXPECT_EQ(receiver.take("10 1B 01 02 03 04 05 06"), IsotpError::none);
  EXPECT_EQ(receiver.answer(), "30 02 F3");
  EXPECT_EQ(receiver.answer(), "") << "only one flow control";
  EXPECT_EQ(receiver.take("21 07 08 09 0A 0B 0C 0D"), IsotpError::none);
  EXPECT_EQ(receiver.answer(), "");
  EXPECT_EQ(receiver.take("22 0E 0F 10 11 12 13 14"), IsotpError::none);
  EXPECT_EQ(receiver.answer(), "30 02 F3");
  EXPECT_TRUE(receiver.datagrams.empty());
  EXPECT_EQ(receiver.take("23 15 16 17 18 19 1A 1B"), IsotpError::none);
  EXPECT_EQ(receiver.answer(), "") << "no flow control after the last frame";
  EXPECT_EQ(receiver.datagrams, std::vector<std::string>{counted(27)});
  expect_counters_add_up(receiver.isotp);
}

TEST(IsotpReceiver, FlowControlUsesThePaddingAndFormatOfTheChannel) {
  IsotpReceiverOptions options = controlled();
  options.channel.padding = true;
  options.channel.padding_byte = 0xAA;
  options.channel.fd = true;
  Receiver receiver(options);
  receiver.take("10 1B 01 02 03 04 05 06");
  CanFrame frame;
  ASSERT_TRUE(receiver.isotp.offer(0, frame));
  EXPECT_EQ(hex_of(frame), "30 00 00 AA AA AA AA AA");
  EXPECT_TRUE(frame.fd);
}

TEST(IsotpReceiver, SendsNothingWhenItOnlyListens) {
  Receiver receiver(listening(), 20);
  receiver.take("10 14 01 02 03 04 05 06");
  EXPECT_EQ(receiver.answer(), "");
  receiver.take(frame_of(id, "30 00 00"));
  receiver.take("21 07 08 09 0A 0B 0C 0D");
  receiver.take("22 0E 0F 10 11 12 13 14");
  EXPECT_EQ(receiver.datagrams, std::vector<std::string>{counted(20)});
  EXPECT_EQ(receiver.take("10 15 01 02 03 04 05 06"), IsotpError::overflow);
  EXPECT_EQ(receiver.answer(), "");
  EXPECT_EQ(receiver.counted(&IsotpReceiverCounters::frames), 4U)
      << "a listener ignores flow control";
  expect_counters_add_up(receiver.isotp);
}

// 9.5.4, 9.6.4.1, 9.6.4.2: the first frame sets the length of the other frames.
TEST(IsotpReceiver, ConsecutiveFramesAreAsLongAsTheFirst) {
  const std::string first = "10 1D " + counting(14);  // RX_DL 16: 29 = 14 + 15 bytes
  const struct {
    std::string size_29, frame;
    IsotpError error;
  } cases[] = {
      {first, "21 " + counting(15, 15), IsotpError::none},
      {first, "21 " + counting(11, 15), IsotpError::malformed},  // too short
      {first, "21 " + counting(19, 15), IsotpError::malformed},  // longer than the first frame
      {"10 0F " + counting(14), "21 0F", IsotpError::none},  // only the last frame may be shorter
      {"10 0F " + counting(14), "21 0F CC CC", IsotpError::none},
      {"10 0F " + counting(14), "21", IsotpError::malformed},
      {"10 1E " + counting(14), "21 " + counting(15, 15), IsotpError::none},
      {"10 1E " + counting(14), "21 " + counting(11, 15), IsotpError::malformed},
  };
  for (const auto& c : cases) {
    Receiver receiver(listening());
    EXPECT_EQ(receiver.take(c.size_29), IsotpError::none);
    EXPECT_EQ(receiver.take(c.frame), c.error) << c.frame;
    EXPECT_TRUE(c.error == IsotpError::none || receiver.isotp.busy())
        << "a malformed frame is ignored";
    expect_counters_add_up(receiver.isotp);
  }
}

// 9.6.4.4
TEST(IsotpReceiver, AnyOtherSequenceNumberEndsTheTransfer) {
  for (int number = 0; number < 16; ++number) {
    Receiver receiver(listening());
    receiver.take("10 1B 01 02 03 04 05 06");
    receiver.take("21 07 08 09 0A 0B 0C 0D");
    CanFrame frame = frame_of(id, "20 0E 0F 10 11 12 13 14");
    frame.data[0] = static_cast<std::uint8_t>(0x20 + number);
    if (number == 2) {
      EXPECT_EQ(receiver.take(frame), IsotpError::none);
      continue;
    }
    EXPECT_EQ(receiver.take(frame), IsotpError::wrong_sequence_number);
    EXPECT_FALSE(receiver.isotp.busy());
    EXPECT_EQ(receiver.take("22 0E 0F 10 11 12 13 14"), IsotpError::unexpected_frame);
    EXPECT_EQ(receiver.counted(&IsotpReceiverCounters::wrong_sequence_number), 1U);
    EXPECT_EQ(receiver.counted(&IsotpReceiverCounters::unexpected_frame), 1U);
    expect_counters_add_up(receiver.isotp);
  }
}

// The end of one transfer and the beginning of the next transfer are lost. The sequence numbers fit
// again, except the number of the short frame between the transfers.
TEST(IsotpReceiver, AShortFrameWithAWrongNumberEndsTheTransfer) {
  Receiver receiver(listening());
  receiver.take("10 19 61 61 61 61 61 61");
  receiver.take("21 61 61 61 61 61 61 61");
  EXPECT_EQ(receiver.take("23 61 61 61 61 61"), IsotpError::wrong_sequence_number);
  EXPECT_EQ(receiver.take("22 62 62 62 62 62 62 62"), IsotpError::unexpected_frame);
  EXPECT_EQ(receiver.take("23 62 62 62 62 62"), IsotpError::unexpected_frame);
  EXPECT_TRUE(receiver.datagrams.empty());

  receiver.take("10 19 61 61 61 61 61 61");
  EXPECT_EQ(receiver.take("22 " + counting(11)), IsotpError::wrong_sequence_number)
      << "a longer frame ends the transfer, too";
  EXPECT_FALSE(receiver.isotp.busy());
  expect_counters_add_up(receiver.isotp);
}

// 9.8.3
TEST(IsotpReceiver, IgnoresConsecutiveFramesThatItDoesNotExpect) {
  Receiver receiver(controlled());
  EXPECT_EQ(receiver.take("21 01"), IsotpError::unexpected_frame) << "without a first frame";
  receiver.take("10 0A 01 02 03 04 05 06");
  EXPECT_EQ(receiver.take("21 07 08 09 0A"), IsotpError::unexpected_frame)
      << "before the flow control";
  receiver.answer();
  EXPECT_EQ(receiver.take("21 07 08 09 0A"), IsotpError::none);
  EXPECT_EQ(receiver.datagrams, std::vector<std::string>{counted(10)});
  expect_counters_add_up(receiver.isotp);
}

// 9.8.3
TEST(IsotpReceiver, ANewTransferReplacesAnUnfinishedOne) {
  for (const int answered : {0, 1}) {
    Receiver receiver(controlled());
    receiver.take("10 0A 61 62 63 64 65 66");
    if (answered) receiver.answer();
    EXPECT_EQ(receiver.take("10 0A 01 02 03 04 05 06"), IsotpError::interrupted);
    EXPECT_EQ(receiver.answer(), "30 00 00");
    EXPECT_EQ(receiver.take("21 07 08 09 0A"), IsotpError::none);
    EXPECT_EQ(receiver.datagrams, std::vector<std::string>{counted(10)});

    receiver.take("10 0A 61 62 63 64 65 66");
    EXPECT_EQ(receiver.take("02 01 02"), IsotpError::interrupted)
        << "reported together with the datagram";
    EXPECT_EQ(receiver.datagrams.back(), counted(2));
    EXPECT_EQ(receiver.answer(), "") << "no flow control for the interrupted transfer";
    EXPECT_EQ(receiver.counted(&IsotpReceiverCounters::interrupted), 2U);
    EXPECT_EQ(receiver.take("10 07 01 02 03 04 05 06"), IsotpError::malformed);
    expect_counters_add_up(receiver.isotp);
  }
}

TEST(IsotpReceiver, AMalformedFrameDoesNotInterrupt) {
  Receiver receiver(listening());
  receiver.take("10 0A 01 02 03 04 05 06");
  for (const char* hex :
       {"", "00", "08 01", "10 07 01 02 03 04 05 06", "10 0A 01", "50", "21 07"}) {
    EXPECT_EQ(receiver.take(hex), IsotpError::malformed) << hex;
  }
  EXPECT_EQ(receiver.take("21 07 08 09 0A"), IsotpError::none);
  EXPECT_EQ(receiver.datagrams, std::vector<std::string>{counted(10)});
  expect_counters_add_up(receiver.isotp);
}

// A frame that arrives in time may be read late. Before this read, the caller may request a frame
// to send.
TEST(IsotpReceiver, ALatePollDoesNotTimeOutTheTransfer) {
  Receiver receiver(controlled());
  receiver.take("10 0A 01 02 03 04 05 06");
  EXPECT_EQ(receiver.answer(), "30 00 00");
  receiver.now = 2 * n_cr_us;
  EXPECT_EQ(receiver.answer(), "");
  receiver.now = n_cr_us - 1;  // the time stamp of the frame
  EXPECT_EQ(receiver.take("21 07 08 09 0A"), IsotpError::none);
  EXPECT_EQ(receiver.datagrams.size(), 1U);
  expect_counters_add_up(receiver.isotp);
}

// 9.8.2, N_Cr: the time since the flow control or the last consecutive frame.
TEST(IsotpReceiver, TimesOutWhenConsecutiveFramesAreMissing) {
  for (const IsotpReceiverOptions& options : {controlled(), listening()}) {
    for (int frames = 0; frames < 3; ++frames) {
      Receiver receiver(options);
      receiver.now = 0xFFFFF000;  // the time wraps during the transfer
      receiver.take("10 FF 01 02 03 04 05 06");
      receiver.answer();
      for (int i = 1; i <= frames; ++i) {
        receiver.now += n_cr_us - 1;
        CanFrame frame = frame_of(id, "20 07 08 09 0A 0B 0C 0D");
        frame.data[0] = static_cast<std::uint8_t>(0x20 + i);
        EXPECT_EQ(receiver.take(frame), IsotpError::none);
      }
      EXPECT_TRUE(receiver.isotp.deadline().armed);
      EXPECT_EQ(receiver.isotp.deadline().at_us, receiver.now + n_cr_us);
      EXPECT_EQ(receiver.isotp.poll(receiver.now + n_cr_us - 1), IsotpError::none);
      EXPECT_EQ(receiver.isotp.poll(receiver.now + n_cr_us), IsotpError::consecutive_timeout);
      EXPECT_EQ(receiver.isotp.poll(receiver.now + n_cr_us), IsotpError::none) << "reported once";
      EXPECT_FALSE(receiver.isotp.deadline().armed);
      EXPECT_EQ(receiver.counted(&IsotpReceiverCounters::consecutive_timeout), 1U);
      expect_counters_add_up(receiver.isotp);
    }
  }
}

TEST(IsotpReceiver, ALateFrameReportsTheTimeoutFirst) {
  Receiver receiver(listening());
  receiver.take("10 0A 01 02 03 04 05 06");
  receiver.now = n_cr_us;
  EXPECT_EQ(receiver.take("21 07 08 09 0A"), IsotpError::consecutive_timeout);
  EXPECT_TRUE(receiver.datagrams.empty());
  EXPECT_EQ(receiver.counted(&IsotpReceiverCounters::unexpected_frame), 1U);
  receiver.take("10 0A 01 02 03 04 05 06");
  receiver.now += n_cr_us;
  EXPECT_EQ(receiver.take("01 01"), IsotpError::consecutive_timeout) << "not interrupted";
  EXPECT_EQ(receiver.datagrams, std::vector<std::string>{counted(1)});
  EXPECT_EQ(receiver.counted(&IsotpReceiverCounters::interrupted), 0U);
  expect_counters_add_up(receiver.isotp);
}

// 9.8.2, N_Ar.
TEST(IsotpReceiver, TimesOutWhenTheBusDoesNotAcceptItsFlowControl) {
  Receiver receiver(controlled());
  receiver.take("10 0A 01 02 03 04 05 06");
  CanFrame frame;
  EXPECT_TRUE(receiver.isotp.offer(0, frame));
  EXPECT_EQ(receiver.isotp.deadline().at_us, 20000U);
  EXPECT_TRUE(receiver.isotp.offer(19999, frame)) << "the same frame again";
  EXPECT_EQ(receiver.isotp.poll(20000), IsotpError::send_timeout);
  EXPECT_FALSE(receiver.isotp.offer(20000, frame));
  EXPECT_FALSE(receiver.isotp.busy());
  expect_counters_add_up(receiver.isotp);
}

// 9.6.3.2
TEST(IsotpReceiver, RefusesADatagramLongerThanItsBuffer) {
  const struct {
    std::string frame, answer;
  } cases[] = {
      {"10 15 01 02 03 04 05 06", "32 00 00"}, {"1F FF 01 02 03 04 05 06", "32 00 00"},
      {"10 00 FF FF FF FF 01 02", "32 00 00"}, {"10 3F " + counting(62), "32 00 00"},
      {"00 15 " + counting(22), ""},  // a single frame is not answered
  };
  for (const auto& c : cases) {
    Receiver receiver(controlled(), 20);
    EXPECT_EQ(receiver.take(c.frame), IsotpError::overflow) << c.frame;
    EXPECT_FALSE(receiver.isotp.busy());
    EXPECT_EQ(receiver.answer(), c.answer);
    EXPECT_EQ(receiver.answer(), "");
    EXPECT_EQ(receiver.take("21 07 08 09 0A 0B 0C 0D"), IsotpError::unexpected_frame);
    EXPECT_EQ(receiver.counted(&IsotpReceiverCounters::overflow), 1U);
    EXPECT_EQ(receiver.buffer, std::string(20, '\xEE')) << "the buffer is unchanged";
    expect_counters_add_up(receiver.isotp);
  }
}

TEST(IsotpReceiver, AnOverflowEndsATransferAndDoesNotAffectTheNext) {
  Receiver receiver(controlled(), 20);
  receiver.take("10 0A 61 62 63 64 65 66");
  EXPECT_EQ(receiver.take("10 15 01 02 03 04 05 06"), IsotpError::interrupted);
  EXPECT_EQ(receiver.counted(&IsotpReceiverCounters::overflow), 1U);
  EXPECT_EQ(receiver.take("10 0A 01 02 03 04 05 06"), IsotpError::none);
  EXPECT_EQ(receiver.answer(), "30 00 00");
  expect_counters_add_up(receiver.isotp);

  receiver.take("10 15 01 02 03 04 05 06");
  CanFrame frame;
  EXPECT_TRUE(receiver.isotp.offer(0, frame));
  EXPECT_EQ(receiver.isotp.poll(20000), IsotpError::send_timeout)
      << "the refusal did not reach the sender";
  EXPECT_EQ(receiver.counted(&IsotpReceiverCounters::refusal_timeout), 1U);
  EXPECT_FALSE(receiver.isotp.deadline().armed);
  expect_counters_add_up(receiver.isotp);
}

// 9.7, 9.8.4
TEST(IsotpReceiver, AsksTheSenderToWaitWhileItIsHeld) {
  IsotpReceiverOptions options = controlled();
  options.max_waits = 2;
  Receiver receiver(options);
  receiver.isotp.hold(true, 0);
  receiver.take("10 0A 01 02 03 04 05 06");
  EXPECT_EQ(receiver.answer(), "31 00 00");
  EXPECT_EQ(receiver.answer(), "");
  EXPECT_EQ(receiver.isotp.deadline().at_us, 10000U);
  receiver.now = 9999;
  EXPECT_EQ(receiver.answer(), "");
  receiver.now = 10000;
  EXPECT_EQ(receiver.answer(), "31 00 00");
  receiver.now = 12345;
  receiver.isotp.hold(false, receiver.now);
  EXPECT_EQ(receiver.answer(), "30 00 00") << "at once";
  EXPECT_EQ(receiver.take("21 07 08 09 0A"), IsotpError::none);
  EXPECT_EQ(receiver.datagrams, std::vector<std::string>{counted(10)});

  receiver.isotp.hold(true, receiver.now);
  receiver.take("10 0A 01 02 03 04 05 06");
  for (int i = 0; i < 2; ++i, receiver.now += 10000) EXPECT_EQ(receiver.answer(), "31 00 00");
  EXPECT_EQ(receiver.isotp.poll(receiver.now), IsotpError::too_many_waits);
  EXPECT_EQ(receiver.answer(), "");
  EXPECT_FALSE(receiver.isotp.busy());
  expect_counters_add_up(receiver.isotp);
}

TEST(IsotpReceiver, IgnoresFramesThatAreNotForIt) {
  Receiver receiver(controlled());
  EXPECT_EQ(receiver.take(frame_of(id + 1, "01 01")), IsotpError::none);
  CanFrame frame = frame_of(id, "01 01");
  frame.extended = true;
  EXPECT_EQ(receiver.take(frame), IsotpError::none);
  frame.extended = false;
  frame.remote = true;
  EXPECT_EQ(receiver.take(frame), IsotpError::none);
  EXPECT_EQ(receiver.counted(&IsotpReceiverCounters::frames), 0U);
  EXPECT_TRUE(receiver.datagrams.empty());
}

TEST(IsotpReceiver, CanBeCancelled) {
  Receiver receiver(controlled());
  receiver.isotp.cancel();
  receiver.take("10 0A 01 02 03 04 05 06");
  receiver.isotp.cancel();
  EXPECT_EQ(receiver.answer(), "");
  EXPECT_EQ(receiver.take("21 07 08 09 0A"), IsotpError::unexpected_frame);
  EXPECT_EQ(receiver.counted(&IsotpReceiverCounters::cancelled), 1U);
  expect_counters_add_up(receiver.isotp);
}

}  // namespace
}  // namespace r4
