// SPDX-License-Identifier: GPL-3.0-or-later
#include "protocol/messages/command_group.hpp"

#include <gtest/gtest.h>

#include <string>
#include <utility>

#include "tests/support/datagrams.hpp"

namespace r4 {
namespace {

using test::str;

// "ok", or the code of the refusal and the index of the command: "FORMAT 2".
std::string judged(const std::string& fields) {
  const std::string bytes = test::with_crc(fields);
  Datagram datagram;
  EXPECT_TRUE(read_datagram(bytes, datagram)) << fields;
  std::uint8_t at = 77;
  CommandGroup group;
  const Refusal refusal = read_group(datagram, group, at);
  if (refusal == Refusal::none) {
    EXPECT_EQ(at, 0) << fields;
    EXPECT_EQ(group.count, datagram.command_count()) << fields;
    return "ok";
  }
  return str(name_of(refusal)) + " " + std::to_string(at);
}

// `count` commands for different outputs.
std::string commands(int count) {
  std::string fields;
  for (int i = 1; i <= count; ++i) {
    fields +=
        i <= 16 ? "S:1500," + std::to_string(i) + ";" : "R:" + std::to_string(i - 16) + ",On;";
  }
  return fields;
}

TEST(CommandGroup, OutputsOfDifferentChannelsFormAGroup) {
  for (const char* fields :
       {"O:358,1,1;O:358,1,2;", "O:1,1,4;D:1,0,4;S:1500,4;R:4,On;P:-5,4;B:1,1,0,4;Z:4;PNum:5;T:1;",
        "X:DAC,1,1650;X:DAC,2,0;O:1,1,1;", "PNum:5;O:1,1,1;T:1;AIN24:1;O:1,1,2;A:1,2,3,4;",
        "Z:1;P:100,1;"}) {
    EXPECT_EQ(judged(fields), "ok") << fields;
  }
  EXPECT_EQ(judged(commands(16)), "ok");
}

TEST(CommandGroup, NamesTheFirstCommandThatCannotBeExecuted) {
  const std::pair<std::string, const char*> cases[] = {
      {"O:1,1,1;O:4096,1,2;O:1,1,5;", "RANGE 2"},
      {"O:1,1,1;O:1,1,2;O:1,1,5;", "CHANNEL 3"},
      {"O:1,1;O:1,1,2;", "FORMAT 1"},
      {"O:1,1,1;X:1;", "UNKNOWN 2"},
      {"O:1,1,1;E:HALT;", "UNKNOWN 2"},
      {"O:1,1,1;N:5,SAFE;", "UNKNOWN 2"},
      {"O:1,1,1;O:1,1,1;", "FORMAT 2"},
      {"S:1,1;O:1,1,1;D:1,1,1;S:2,1;", "FORMAT 4"},
      {"R:1,On;R:1,Off;", "FORMAT 2"},
      {"P:1,1;P:1,500,1;", "FORMAT 2"},
      {"O:1,1,1;O:1,1,2;PNum:5;T:1;O:1,1,1;O:1,1,2;", "FORMAT 3"},
      {"X:DAC,1,1;X:DAC,1,2;", "FORMAT 2"},
      {"O:1,1,1;X:DAC,2,3301;", "RANGE 2"},
      {"O:1,1,1;X:DAC,3,1;", "CHANNEL 2"},
      // Commands that need a transfer and cannot be in a group.
      {"O:1,1,1;X:UART,1,x41;", "FORMAT 2"},
      {"X:WRITE,104,x6b00;O:1,1,1;", "FORMAT 1"},
      {"O:1,1,1;X:READ,104,x75,1;", "FORMAT 2"},
      // Commands that are not for an output.
      {"O:1,1,1;C:rate,50;", "FORMAT 2"},
      {"U:10,1;O:1,1,1;", "FORMAT 1"},
      {"F:ALL;O:1,1,1;", "FORMAT 1"},
      {"O:1,1,1;Q:ID;", "FORMAT 2"},
      {"O:1,1,1;H:ROS2-R4;", "FORMAT 2"},
      {"E:CLEAR,1;O:1,1,1;", "FORMAT 1"},
      {"O:1,1,1;E:STOP;", "FORMAT 2"},
  };
  for (const auto& [fields, verdict] : cases) EXPECT_EQ(judged(fields), verdict) << fields;
  EXPECT_EQ(judged(commands(17)), "FORMAT 17");
  EXPECT_EQ(judged(commands(24)), "FORMAT 17");
}

TEST(CommandGroup, RefusesADatagramFullOfFields) {
  std::string fields;
  while (fields.size() + 30 < max_datagram) fields += "Z:1;";
  EXPECT_EQ(judged(fields), "FORMAT 2");
  fields.clear();
  while (fields.size() + 30 < max_datagram) fields += "V:;";
  EXPECT_EQ(judged(fields), "UNKNOWN 1");
}

}  // namespace
}  // namespace r4
