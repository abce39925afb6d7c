// SPDX-License-Identifier: GPL-3.0-or-later
// A UART of the user: the received bytes in the states, and the bytes to send.
#include "firmware/devices/user_uart.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "firmware/ports/sim/devices/user_uart_model.hpp"

namespace r4::firmware {
namespace {

using sim::UartPeer;

// The test decides when bytes arrive.
struct Line final : UserUartPort {
  void set_up(const UartMode& wanted) override {
    mode = wanted;
    ++set_ups;
  }
  std::size_t receive(std::uint8_t* out, std::size_t size) override {
    const std::size_t count = std::min(size, waiting.size());
    std::copy_n(waiting.begin(), count, out);
    waiting.erase(0, count);
    return count;
  }
  std::uint32_t take_lost() override { return std::exchange(lost, 0); }
  bool send(const std::uint8_t* bytes, std::size_t size) override {
    if (sent.size() + size > send_capacity) return false;
    sent.append(bytes, bytes + size);
    return true;
  }
  void drop() override { sent.clear(); }
  UartMode mode;
  int set_ups = 0;
  std::string waiting, sent;
  std::uint32_t lost = 0;
};

UartMode mode_of(std::uint32_t baud) {
  UartMode mode;
  mode.baud = baud;
  return mode;
}

class UserUartTest : public testing::Test {
 protected:
  UserUartTest() { uart.set_up(mode_of(115200)); }
  void arrive(const std::string& bytes) {
    line.waiting += bytes;
    while (!line.waiting.empty()) uart.poll();
  }
  // The UART fields of the next state: "position lost bytes".
  std::string state() {
    uart.next_state();
    return told();
  }
  std::string told() const {
    UartBytes bytes;
    uart.tell(bytes);
    return std::to_string(bytes.position) + " " + std::to_string(bytes.lost) + " " +
           std::string(bytes.data.begin(), bytes.data.end());
  }
  Line line;
  UserUart uart{line};
};

TEST_F(UserUartTest, EachStateHasTheNewBytesAndRepeatsThePreviousOnes) {
  arrive("abc");
  EXPECT_EQ(state(), "0 0 abc");
  EXPECT_EQ(told(), "0 0 abc") << "every reader of one state gets the same";
  arrive("de");
  EXPECT_EQ(state(), "0 0 abcde");
  EXPECT_EQ(state(), "3 0 de");
  EXPECT_EQ(state(), "5 0 ");
}

TEST_F(UserUartTest, NewBytesTakePrecedenceOverRepeatedBytes) {
  arrive(std::string(64, 'a') + std::string(26, 'b'));
  EXPECT_EQ(state(), "0 0 " + std::string(64, 'a'));
  EXPECT_EQ(state(), "26 0 " + std::string(38, 'a') + std::string(26, 'b'));
  EXPECT_EQ(state(), "64 0 " + std::string(26, 'b'));
}

TEST_F(UserUartTest, CountsDroppedAndDamagedBytes) {
  arrive(std::string(UserUart::backlog + 7, 'x'));
  line.lost = 5;
  uart.poll();
  EXPECT_EQ(state(), "0 12 " + std::string(64, 'x'));
  arrive("y");
  std::string last;
  for (int i = 0; i < 20; ++i) {
    const std::string now = state();
    if (now.find('y') != std::string::npos) last = now;
  }
  constexpr std::uint32_t with_it = UserUart::backlog % uart_max_bytes;
  EXPECT_EQ(last,
            std::to_string(UserUart::backlog - with_it) + " 12 " + std::string(with_it, 'x') + "y")
      << "the position is that of the bytes that were kept";
}

// 115200 baud, 8N1: 11.52 bytes a millisecond, and a state every 10 ms.
TEST_F(UserUartTest, ReportsABurstOf530BytesWithoutLoss) {
  std::string sent;
  for (int i = 0; i < 530; ++i) sent += static_cast<char>('a' + i % 26);
  std::string heard;
  for (std::size_t ms = 1; ms <= 200; ++ms) {
    const std::size_t before = std::min(sent.size(), (ms - 1) * 1152 / 100);
    const std::size_t now = std::min(sent.size(), ms * 1152 / 100);
    if (now > before) arrive(sent.substr(before, now - before));
    if (ms % 10 != 0) continue;
    uart.next_state();
    UartBytes bytes;
    uart.tell(bytes);
    ASSERT_EQ(bytes.lost, 0U);
    heard.append(bytes.data.begin() + (heard.size() - bytes.position), bytes.data.end());
  }
  EXPECT_EQ(heard, sent);
}

TEST_F(UserUartTest, KeepsTheOrderWhenTheRingWraps) {
  std::string sent;
  std::string heard;
  for (std::size_t i = 0; sent.size() < 10 * UserUart::capacity; ++i) {
    const std::string burst(i % 60, static_cast<char>('a' + i % 26));
    sent += burst;
    arrive(burst);
    uart.next_state();
    UartBytes bytes;
    uart.tell(bytes);
    ASSERT_LE(bytes.position, heard.size());
    heard.append(bytes.data.begin() + (heard.size() - bytes.position), bytes.data.end());
  }
  EXPECT_EQ(heard, sent);
}

TEST_F(UserUartTest, ASessionGetsNoBytesFromBeforeItBegan) {
  arrive("old");
  state();
  arrive("older");
  uart.forget();
  EXPECT_EQ(state(), "8 0 ");
  arrive("new");
  EXPECT_EQ(state(), "8 0 new");
}

TEST_F(UserUartTest, IsSetUpOnlyWhenSomethingChanges) {
  uart.set_up(mode_of(115200));
  EXPECT_EQ(line.set_ups, 1);
  uart.set_up(mode_of(9600));
  EXPECT_EQ(line.mode.baud, 9600U);
  uart.set_up(UartMode());
  EXPECT_FALSE(uart.on());
  line.waiting = "x";
  uart.poll();
  EXPECT_EQ(line.waiting, "x") << "the UART is off";
}

TEST_F(UserUartTest, PositionsCountEveryByte) {
  std::uint32_t next = 0;
  for (int i = 0; i < 3000; ++i) {
    arrive(std::string(50, static_cast<char>('a' + i % 26)));
    uart.next_state();
    UartBytes bytes;
    uart.tell(bytes);
    EXPECT_LE(bytes.position, next);
    next = bytes.position + bytes.data.size;
    EXPECT_EQ(next, 50U * static_cast<std::uint32_t>(i + 1));
    EXPECT_EQ(bytes.data.bytes[bytes.data.size - 1], 'a' + i % 26);
  }
}

// --- the model of the line

class UserUartOnTheModel : public testing::Test {
 protected:
  void listen(std::uint32_t baud, UartPeer peer, int ms, int period_ms = 10) {
    model.connect(peer);
    uart.set_up(mode_of(baud));
    for (int i = 1; i <= ms; ++i) {
      model.pass_millisecond();
      uart.poll();
      if (i % period_ms != 0) continue;
      uart.next_state();
      UartBytes bytes;
      uart.tell(bytes);
      EXPECT_LE(bytes.position, next) << "no byte is left out";
      heard.append(bytes.data.begin() + (next - bytes.position), bytes.data.end());
      next = bytes.position + bytes.data.size;
      lost = bytes.lost;
    }
  }
  sim::UserUartModel model;
  UserUart uart{model};
  std::string heard;
  std::uint32_t next = 0;
  std::uint32_t lost = 0;
};

TEST_F(UserUartOnTheModel, ReceivesAGnssReceiverAt10HzWithoutLoss) {
  listen(115200, UartPeer::gnss, 5000);
  EXPECT_EQ(lost, 0U);
  int sentences = 0;
  for (std::size_t at = 0; at < heard.size();) {
    const std::size_t end = heard.find("\r\n", at);
    if (end == std::string::npos) break;
    const std::string line = heard.substr(at, end - at);
    ASSERT_EQ(line[0], '$');
    unsigned sum = 0;
    for (std::size_t i = 1; i < line.size() - 3; ++i) sum ^= static_cast<unsigned char>(line[i]);
    EXPECT_EQ(std::stoul(line.substr(line.size() - 2), nullptr, 16), sum) << line;
    at = end + 2;
    ++sentences;
  }
  EXPECT_GE(sentences, 49 * 5);
}

TEST_F(UserUartOnTheModel, ReceivesALidarAt100HzWithoutLoss) {
  listen(115200, UartPeer::lidar, 2000);
  EXPECT_EQ(lost, 0U);
  EXPECT_GE(heard.size(), 198U * 9);
  for (std::size_t at = 0; at + 9 <= heard.size(); at += 9) {
    EXPECT_EQ(heard.substr(at, 2), "YY");
    unsigned sum = 0;
    for (std::size_t i = 0; i < 8; ++i) sum += static_cast<unsigned char>(heard[at + i]);
    EXPECT_EQ(static_cast<unsigned char>(heard[at + 8]), sum & 0xFF);
  }
}

TEST_F(UserUartOnTheModel, CountsBytesThatDoNotFit) {
  listen(uart_max_baud, UartPeer::noise, 1000);
  EXPECT_EQ(heard.size(), 6400U) << "64 in each state";
  // Each byte that the peer sent is in a state, counted as lost, or waiting.
  EXPECT_NEAR(static_cast<double>(heard.size() + lost), model.said(), 256 + UserUart::backlog);
  EXPECT_GE(heard.size() + lost + 256 + UserUart::backlog, model.said());
}

TEST_F(UserUartOnTheModel, AWrongBaudRateDamagesEveryByte) {
  listen(9600, UartPeer::gnss, 1000);
  EXPECT_EQ(heard, "");
  EXPECT_GT(lost, 3000U);
}

TEST_F(UserUartOnTheModel, SendingTakesTimeAndWaitingBytesCanBeDropped) {
  model.connect(UartPeer::loop);
  uart.set_up(mode_of(9600));
  const std::string text(48, 'z');
  const auto* const bytes = reinterpret_cast<const std::uint8_t*>(text.data());
  EXPECT_TRUE(uart.write(bytes, text.size()));
  EXPECT_TRUE(uart.write(bytes, text.size()));
  EXPECT_FALSE(uart.write(bytes, text.size()))
      << "at most 128 bytes wait, and a write is kept whole or refused";
  for (int i = 0; i < 10; ++i) model.pass_millisecond();
  EXPECT_NEAR(model.sent(), 9, 1);
  uart.drop_writes();
  const std::uint32_t sent = model.sent();
  for (int i = 0; i < 100; ++i) model.pass_millisecond();
  EXPECT_EQ(model.sent(), sent);
}

}  // namespace
}  // namespace r4::firmware
