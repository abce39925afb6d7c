// SPDX-License-Identifier: GPL-3.0-or-later
// Compares the length of frames with published values, and with a second computation that writes
// every bit as a character.
#include "r4link/can/can_bits.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <bitset>
#include <string>
#include <string_view>
#include <vector>

#include "tests/transports/framing/can/can_frames.hpp"
#include "transports/framing/can/isotp_sender.hpp"

namespace r4 {
namespace {

constexpr CanBitRate at_one_mbit{1000000, 0};
constexpr CanBitRate half_mbit{500000, 0};
constexpr CanBitRate one_and_five_mbit{1000000, 5000000};

// CRC delimiter, acknowledge slot and delimiter, end of frame, intermission.
constexpr std::string_view tail = "1011111111111";

std::string zeros(std::size_t count) { return std::string(count, '0'); }

template <std::size_t Width>
std::string binary(std::uint32_t value) {
  return std::bitset<Width>(value).to_string();
}

// Long division of the bits, followed by zeros for the remainder (ISO 11898-1:2015, 10.4.2.6).
std::string crc15(const std::string& bits) {
  const std::string divisor = "1100010110011001";
  std::string rest = bits + zeros(15);
  for (std::size_t at = 0; at < bits.size(); ++at) {
    if (rest[at] == '0') continue;
    for (std::size_t i = 0; i < divisor.size(); ++i) {
      rest[at + i] = rest[at + i] == divisor[i] ? '0' : '1';
    }
  }
  return rest.substr(bits.size());
}

std::string stuffed(const std::string& bits) {
  std::string out;
  for (const char bit : bits) {
    out += bit;
    if (out.size() >= 5 && out.substr(out.size() - 5) == std::string(5, bit)) {
      out += bit == '0' ? '1' : '0';
    }
  }
  return out;
}

std::string data_of(const CanFrame& frame) {
  std::string bits;
  for (int i = 0; i < frame.size; ++i) bits += binary<8>(frame.data[i]);
  return bits;
}

std::size_t classic_bits(const CanFrame& frame) {
  const std::string request = frame.remote ? "1" : "0";
  std::string bits = frame.extended ? "0" + binary<11>(frame.id >> 18) + "11" +
                                          binary<18>(frame.id & 0x3FFFF) + request + "00"
                                    : "0" + binary<11>(frame.id) + request + "00";
  bits += binary<4>(frame.size);
  if (!frame.remote) bits += data_of(frame);
  return stuffed(bits + crc15(bits)).size() + tail.size();
}

// The bits of an FD frame. The length of its CRC field does not depend on the value of the CRC.
std::size_t fd_bits(const CanFrame& frame, bool switches) {
  const int sizes[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
  std::uint32_t code = 0;
  while (sizes[code] != frame.size) ++code;
  std::string bits = frame.extended
                         ? "0" + binary<11>(frame.id >> 18) + "11" + binary<18>(frame.id & 0x3FFFF)
                         : "0" + binary<11>(frame.id);
  bits += frame.extended ? "010" : "0010";  // RRS, (IDE,) FDF, res
  bits += switches ? "10" : "00";           // BRS, ESI
  bits += binary<4>(code) + data_of(frame);
  // No stuff bit follows the last bit, because the CRC field begins with a fixed stuff bit.
  const std::size_t before_crc = stuffed(bits.substr(0, bits.size() - 1)).size() + 1;
  const std::size_t crc_field = frame.size <= 16 ? 27 : 32;
  return before_crc + crc_field + tail.size();
}

CanFrame any_frame() {
  CanFrame frame{};
  frame.fd = *rc::gen::arbitrary<bool>();
  frame.extended = *rc::gen::arbitrary<bool>();
  frame.remote = !frame.fd && *rc::gen::inRange(0, 8) == 0;
  frame.id = *rc::gen::arbitrary<std::uint32_t>() & (frame.extended ? 0x1FFFFFFFU : max_can_id);
  frame.size = can_frame_size(static_cast<std::uint32_t>(*rc::gen::inRange(0, frame.fd ? 65 : 9)));
  // The bytes include long runs of equal bits, which need stuff bits.
  const std::vector<std::uint8_t> bytes = *rc::gen::elementOf(
      std::vector<std::vector<std::uint8_t>>{{0x00}, {0xFF}, {0x0F}, {0x3C, 0x1E}, {}});
  for (std::size_t i = 0; i < frame.size; ++i) {
    frame.data[i] = bytes.empty() ? *rc::gen::arbitrary<std::uint8_t>() : bytes[i % bytes.size()];
  }
  return frame;
}

TEST(CanBits, MatchThePublishedBitsOfAClassicFrame) {
  // 55 + 10 n bits with 11-bit ids, 80 + 10 n with 29-bit ids. Tindell, Burns: "Guaranteeing
  // message latencies on CAN"; Davis, Burns, Bril, Lukkien: "Controller Area Network (CAN)
  // schedulability analysis", equations 1 and 2.
  for (std::uint8_t size = 0; size <= 8; ++size) {
    EXPECT_EQ(total(least_can_bits(size, false, false)), 47U + 8U * size);
    EXPECT_EQ(total(worst_can_bits(size, false, false)), 55U + 10U * size);
    EXPECT_EQ(total(least_can_bits(size, false, true)), 67U + 8U * size);
    EXPECT_EQ(total(worst_can_bits(size, false, true)), 80U + 10U * size);
  }
  EXPECT_EQ(total(worst_can_bits(8, false, false)), 135U);
  EXPECT_EQ(total(worst_can_bits(8, false, true)), 160U);
}

TEST(CanBits, MatchFramesCountedByHand) {
  CanFrame frame{};
  // 34 zeros, because the CRC is also 0. A stuff bit follows every five zeros.
  EXPECT_EQ(total(can_bits(frame)), 47U + 6U);
  // SOF and id 0 are 12 zeros. Stuff bits follow after 5 and 10 zeros. Then the other 4 of the 14
  // bits before FDF follow.
  frame = test::frame_of(0, "");
  frame.fd = true;
  const CanBits bits = can_bits(frame);
  EXPECT_EQ(bits.nominal, 14U + 2U + 3U + 12U);
  // ESI and length code are five zeros after a BRS of 1. The fixed stuff bit follows anyway.
  EXPECT_EQ(bits.data, 5U + 27U + 1U);
}

TEST(CanBits, TheCrcFieldOfAnFdFrameGrowsAt17Bytes) {
  EXPECT_EQ(least_can_bits(16, true, false).data, 5U + 8U * 16 + 27 + 1);
  EXPECT_EQ(least_can_bits(20, true, false).data, 5U + 8U * 20 + 32 + 1);
  EXPECT_EQ(least_can_bits(20, true, false).nominal, 17U + 12U);
  EXPECT_EQ(least_can_bits(20, true, true).nominal, 36U + 12U);
}

RC_GTEST_PROP(CanBits, AreThoseOfASecondComputation, ()) {
  const CanFrame frame = any_frame();
  const bool switches = *rc::gen::arbitrary<bool>();
  const std::size_t expected = frame.fd ? fd_bits(frame, switches) : classic_bits(frame);
  RC_ASSERT(total(can_bits(frame, switches)) == expected);
}

RC_GTEST_PROP(CanBits, AreNeverMoreThanTheWorstOrFewerThanTheLeast, ()) {
  const CanFrame frame = any_frame();
  const bool switches = *rc::gen::arbitrary<bool>();
  const std::uint8_t size = frame.remote ? 0 : frame.size;
  const CanBits exact = can_bits(frame, switches);
  const CanBits worst = worst_can_bits(size, frame.fd, frame.extended, switches);
  const CanBits least = least_can_bits(size, frame.fd, frame.extended, switches);
  RC_ASSERT(least.nominal <= exact.nominal && exact.nominal <= worst.nominal);
  RC_ASSERT(least.data <= exact.data && exact.data <= worst.data);
  RC_ASSERT((exact.data != 0) == (frame.fd && switches));
}

TEST(CanBits, ARealFdFrameHasTheWorstHeader) {
  CanFrame frame{};
  frame.fd = true;
  frame.id = 0x078;  // 0 0000 [1] 1111 [0] 000 0
  EXPECT_EQ(can_bits(frame).nominal, worst_can_bits(0, true, false).nominal);
  EXPECT_EQ(worst_can_bits(64, true, false).data, least_can_bits(64, true, false).data + 129U);
}

TEST(CanBits, ConvertToTime) {
  EXPECT_EQ(time_ns(CanBits{135, 0}, at_one_mbit), 135000U);
  EXPECT_EQ(time_ns(CanBits{135, 0}, half_mbit), 270000U);
  EXPECT_EQ(time_ns(CanBits{30, 100}, one_and_five_mbit), 50000U);
  EXPECT_EQ(time_ns(CanBits{1, 0}, {3, 0}), 333333334U) << "rounded up";
  CanFrame frame{};
  frame.fd = true;
  EXPECT_EQ(time_ns(frame, at_one_mbit), 1000U * total(can_bits(frame, false)))
      << "without a data rate the frame does not switch";
}

// The longest time of a datagram: all its frames and one flow control.
std::uint64_t worst_ns(std::size_t size, std::uint8_t tx_dl, CanBitRate rate) {
  IsotpSenderOptions options;
  options.channel.fd = tx_dl > 8;
  options.tx_dl = tx_dl;
  options.flow_control = false;
  IsotpSender sender(options);
  const std::string datagram(size, 'x');
  sender.begin(datagram, 0);
  std::uint64_t sum = time_ns(worst_can_bits(3, options.channel.fd, false), rate);
  for (CanFrame frame; sender.offer(0, frame); sender.frame_sent(0)) {
    sum += time_ns(worst_can_bits(frame.size, frame.fd, false), rate);
  }
  return sum;
}

TEST(CanBits, GiveTheLongestTimeOfADatagram) {
  EXPECT_EQ(worst_ns(170, 8, at_one_mbit), 3420000U) << "25 frames and a flow control";
  EXPECT_EQ(worst_ns(170, 8, half_mbit), 6840000U);
  EXPECT_EQ(1000000000U / worst_ns(170, 8, at_one_mbit), 292U) << "datagrams a second";
  EXPECT_EQ(worst_ns(45, 8, at_one_mbit), 1000000U) << "7 frames and a flow control";
  EXPECT_EQ(worst_ns(170, 64, one_and_five_mbit), 516200U) << "3 frames and a flow control";
}

// The design: an emergency stop waits for one frame on the bus and takes one frame time, within 270
// us.
TEST(CanBits, TwoFramesAreLessThan270Microseconds) {
  EXPECT_LE(2 * time_ns(worst_can_bits(8, false, false), at_one_mbit), 270000U);
}

}  // namespace
}  // namespace r4
