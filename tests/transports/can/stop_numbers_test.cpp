// SPDX-License-Identifier: GPL-3.0-or-later
#include "transports/can/stop_numbers.hpp"

#include <gtest/gtest.h>

#include <string>

#include "tests/support/datagrams.hpp"

namespace r4::test {
namespace {

std::string in_full(const StopNumbers& numbers, const std::string& datagram) {
  char room[max_datagram];
  return str(numbers.in_full(Text(datagram), room));
}
std::string stopped_by(std::uint32_t number) {
  return with_crc("H:R4-ROS2;PNum:12;T:790;SAFE:2;CAUSE:734003;STOP:" + std::to_string(number) +
                  ";AN:0123456789abcdef;");
}

TEST(StopNumbers, RestoreTheFullNumberInAHeartbeat) {
  StopNumbers numbers;
  numbers.add(3000000001, 5);
  EXPECT_EQ(in_full(numbers, stopped_by(5)), stopped_by(3000000001));
}

TEST(StopNumbers, ChangeNothingElse) {
  StopNumbers numbers;
  EXPECT_EQ(in_full(numbers, stopped_by(5)), stopped_by(5)) << "no stop is known yet";
  numbers.add(3000000001, 5);
  const std::string damaged = stopped_by(5).replace(2, 1, "X");
  for (const std::string& each :
       {stopped_by(6), with_crc("H:R4-ROS2;PNum:12;T:790;SAFE:2;"), damaged, std::string(),
        with_crc("AIN24:23.5;STOP:5;PNum:7;T:8;")}) {
    EXPECT_EQ(in_full(numbers, each), each);
  }
}

TEST(StopNumbers, KeepTheNewestSixteenStops) {
  StopNumbers numbers;
  for (std::uint32_t i = 0; i <= StopNumbers::most; ++i) numbers.add(1000 + i, i);
  std::uint32_t carried = 0;
  EXPECT_FALSE(numbers.find(1000, carried));
  EXPECT_FALSE(numbers.carries(0));
  ASSERT_TRUE(numbers.find(1000 + StopNumbers::most, carried));
  EXPECT_EQ(carried, StopNumbers::most);
}

}  // namespace
}  // namespace r4::test
