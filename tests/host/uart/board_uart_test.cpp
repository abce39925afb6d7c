// SPDX-License-Identifier: GPL-3.0-or-later
// The user's UARTs through r4::Board: bytes joined from states.
#include <gtest/gtest.h>

#include <random>
#include <string>

#include "firmware/devices/user_uart.hpp"
#include "host/uart/uart_stream.hpp"
#include "r4link/board.hpp"
#include "r4link/error.hpp"
#include "tests/support/driven_board.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

UartBytes field(std::uint32_t position, std::uint32_t lost, const std::string& bytes) {
  UartBytes field;
  field.position = position;
  field.lost = lost;
  field.data.size = static_cast<std::uint8_t>(bytes.size());
  std::copy(bytes.begin(), bytes.end(), field.data.bytes);
  return field;
}

std::string text(const Board::UartData& data) { return {data.bytes.begin(), data.bytes.end()}; }

TEST(UartStream, DeliversEachByteOnceAndCountsMissingBytes) {
  UartStream stream;
  Board::UartData data;
  EXPECT_TRUE(stream.take(field(100, 7, "abc"), data));
  EXPECT_TRUE(stream.take(field(100, 7, "abcde"), data));
  EXPECT_FALSE(stream.take(field(103, 7, "de"), data));
  EXPECT_FALSE(stream.take(field(105, 7, ""), data));
  EXPECT_EQ(text(data), "abcde");
  EXPECT_EQ(data.lost, 0U) << "earlier losses of the board must not count";
  EXPECT_TRUE(stream.take(field(109, 7, "j"), data));
  EXPECT_EQ(text(data), "abcdej");
  EXPECT_EQ(data.lost, 4U);
  EXPECT_TRUE(stream.take(field(109, 10, "j"), data))
      << "the gap must be accepted, because the board has lost bytes";
  EXPECT_EQ(data.lost, 7U);
  EXPECT_FALSE(stream.take(field(100, 7, "abc"), data)) << "a late state must not count";
  EXPECT_EQ(text(data), "abcdej");
}

TEST(UartStream, FollowsPositionsOverAWrapAndARestart) {
  UartStream stream;
  Board::UartData data;
  stream.take(field(0xFFFFFFFE, 0xFFFFFFFF, "abc"), data);
  stream.take(field(1, 0, "d"), data);
  EXPECT_EQ(text(data), "abcd");
  EXPECT_EQ(data.lost, 1U);
  stream.restart();
  stream.take(field(0, 0, "x"), data);
  EXPECT_EQ(text(data), "abcdx");
  EXPECT_EQ(data.lost, 1U);
}

TEST(UartStream, KeepsTheNewestBytesAndCountsOlderBytesAsLost) {
  UartStream stream;
  Board::UartData data;
  for (std::uint32_t i = 0; i < 2000; ++i)
    stream.take(field(64 * i, 0, std::string(64, 'x')), data);
  EXPECT_EQ(data.bytes.size(), UartStream::capacity);
  EXPECT_EQ(data.bytes.size() + data.lost, 2000U * 64);
}

// The test includes the board's side of the stream.
TEST(UartStream, DeliversOrCountsEachByteWhenStatesAreLost) {
  struct Line final : firmware::UserUartPort {
    void set_up(const UartMode&) override {}
    std::size_t receive(std::uint8_t* out, std::size_t size) override {
      const std::size_t count = std::min(size, due);
      for (std::size_t i = 0; i < count; ++i) out[i] = static_cast<std::uint8_t>(said++ % 251);
      due -= count;
      return count;
    }
    std::uint32_t take_lost() override { return 0; }
    bool send(const std::uint8_t*, std::size_t) override { return true; }
    void drop() override {}
    std::size_t due = 0;
    std::uint32_t said = 0;
  };
  for (const unsigned most : {60U, 150U}) {  // bytes per period
    std::mt19937 random(most);
    Line line;
    firmware::UserUart uart(line);
    UartMode mode;
    mode.baud = 115200;
    uart.set_up(mode);
    UartStream stream;
    std::uint64_t at = 0;
    bool before = false;
    for (int i = 0; i < 5000; ++i) {
      line.due += random() % most;
      for (int turn = 0; turn < 3; ++turn) uart.poll();
      uart.next_state();
      UartBytes told;
      uart.tell(told);
      const bool lost = i != 0 && random() % 10 == 0 && !before;  // never two in a row
      before = lost && most == 60;
      if (lost) continue;
      Board::UartData data;
      stream.take(told, data);
      if (most == 60 && i % 100 == 0) line.due = 0;
      at += data.lost;
      for (const std::uint8_t byte : data.bytes) {
        if (told.lost == 0) {
          ASSERT_EQ(byte, at % 251);
        }
        ++at;
      }
    }
    EXPECT_GE(at + firmware::UserUart::capacity, line.said);
    EXPECT_LE(at, line.said);
  }
}

struct DrivenUart : DrivenBoard {
  std::mutex mutex;
  Board::UartData reported;  // protected by the mutex
};

TEST_F(DrivenUart, ReadsTheBytesOfAReceiverAndCallsBack) {
  const ScopedSubscription reports = board.uart(1).on_bytes([&](const Board::UartData& data) {
    const std::lock_guard lock(mutex);
    reported.bytes.insert(reported.bytes.end(), data.bytes.begin(), data.bytes.end());
    reported.lost += data.lost;
  });
  board.fields("DEFAULT,UART1");
  board.setting("uart1", "115200:8N1");
  std::string read;
  std::uint64_t lost = 0;
  for (int i = 0; i < 200 && read.size() < 1000; ++i) {
    const Board::UartData data = board.uart(1).read(1s);
    lost += data.lost;
    read += text(data);
  }
  EXPECT_TRUE(contains(read, "$GPRMC,"));
  board.next_state();
  board.next_state();
  {
    const std::lock_guard lock(mutex);
    EXPECT_TRUE(contains(text(reported), "$GPRMC,"));
    if (lost + reported.lost == 0) {
      EXPECT_EQ(text(reported).compare(0, 200, read, 0, 200), 0);
    }
  }
  EXPECT_THROW(board.uart(3), Error);
  EXPECT_TRUE(board.uart(2).read().bytes.empty());
}

TEST(BoardUart, WritesBytesAndVoltagesOnlyAfterArm) {
  BoardInAThread simulated("udp");
  Board board(simulated.url());
  board.wait_active();
  board.setting("uart2", "115200:8N1");
  EXPECT_THROW(board.uart(2).write({'a'}), Error);
  EXPECT_THROW(board.dac(1, Millivolts(1000)), Error);
  board.arm();
  board.uart(2).write({'a', 'b'});
  EXPECT_THROW(board.uart(2).write({}), Error);
  EXPECT_THROW(board.uart(2).write(std::vector<std::uint8_t>(49)), Error);
  EXPECT_THROW(board.uart(1).write({'a'}), Error) << "the UART is off";
  board.fields("DAC1,GPIO");
  board.dac(1, Millivolts(1650));
  ReceivedState state = board.next_state();
  for (int i = 0; i < 100 && state.dac_mv(1) != 1650; ++i) state = board.next_state();
  EXPECT_EQ(state.dac_mv(1), 1650);
  EXPECT_TRUE(state.input(1));
  EXPECT_THROW(board.dac(1, Millivolts(3301)), Error);
}

}  // namespace
}  // namespace r4::test
