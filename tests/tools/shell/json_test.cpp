// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/r4/shell/json.hpp"

#include <gtest/gtest.h>

#include "tests/support/datagrams.hpp"

namespace r4::tool {
namespace {

std::string as_json(std::string_view value) { return value_json(Text(value)).dump(); }

TEST(Json, ShowsNumbersAsNumbersWithoutLosingADigit) {
  EXPECT_EQ(as_json("24.28"), "24.28");
  EXPECT_EQ(as_json("-100"), "-100");
  EXPECT_EQ(as_json("0"), "0");
  EXPECT_EQ(as_json("-0.05"), "-0.05");
  EXPECT_EQ(as_json("4294967295"), "4294967295");
  EXPECT_EQ(as_json("18446744073709551615"), "18446744073709551615");
}

TEST(Json, ShowsInvalidNumbersAsText) {
  for (const char* text : {"", "-", ".5", "5.", "007", "1e5", "0x10", "1-2", "1.2.3", "+1", "nan",
                           "18446744073709551616", "123456789012345678901234567890"}) {
    EXPECT_EQ(as_json(text), '"' + std::string(text) + '"');
  }
}

TEST(Json, KeepsTheOrderOfFieldsAndShowsSeveralValuesOfANameAsAnArray) {
  const std::string bytes =
      test::with_crc("DHB1A:4095,1;AIN24:24.28;H:R4-ROS2;E:;X:1;X:a;PNum:1;T:2;");
  Datagram datagram;
  ASSERT_TRUE(read_datagram(Text(bytes), datagram));
  EXPECT_EQ(fields_json(datagram).dump(),
            R"({"DHB1A":[4095,1],"AIN24":24.28,"H":"R4-ROS2","E":"","X":[1,"a"]})");
}

TEST(Json, EscapesBytesReversibly) {
  EXPECT_EQ(escaped(std::string_view("a\\b\0\n\xff ~", 8)), "a\\x5cb\\x00\\x0a\\xff ~");
}

TEST(Json, PrintsOneLineOfAsciiAndReplacesInvalidUtf8) {
  EXPECT_EQ(line_of({{"thing", "\xff"}}), "{\"thing\":\"\\ufffd\"}\n");
  EXPECT_EQ(line_of({{"thing", "\x1b\u009b\x7f\u202eö"}}),
            "{\"thing\":\"\\u001b\\u009b\\u007f\\u202e\\u00f6\"}\n");
}

TEST(Json, MasksTheSecretsOfADatagram) {
  const auto json_of = [](const std::string& bytes) {
    Json object;
    add_datagram_json(object, bytes);
    return object.dump();
  };
  const std::string good = test::with_crc("C:password,letmein!;PNum:1;T:2;");
  const std::string masked = test::with_crc("C:password,...;PNum:1;T:2;");
  EXPECT_EQ(json_of(good),
            R"({"ok":true,"type":"command","pnum":1,"t":2,"fields":{"C":["password",)"
            R"("..."]},"text":")" +
                masked + "\"}");
  const std::string damaged = good.substr(0, good.size() - 1);
  EXPECT_EQ(json_of(damaged), R"({"ok":false,"error":"syntax","position":)" +
                                  std::to_string(damaged.size()) + R"(,"text":"C:password,..."})");
}

TEST(Json, PrintableLinesKeepsLineBreaks) {
  EXPECT_EQ(printable_lines("a\nb\x1b[2J\n\nc"), "a\nb\\x1b[2J\n\nc");
  EXPECT_EQ(printable_lines("a\n"), "a\n");
  EXPECT_EQ(printable_lines(""), "");
}

TEST(Json, CountsTheDatagramsOfATransportAndItsTransfersIfItHasThem) {
  CarrierCounters counters;
  counters.rx_datagrams = 5;
  counters.tx_datagrams = 7;
  counters.tx_dropped = 2;
  counters.rx_overflows = 3;
  Json json = counters_json(counters);
  EXPECT_EQ(json["received"], 5);
  EXPECT_EQ(json["sent"], 7);
  EXPECT_EQ(json["dropped"], 2);
  EXPECT_FALSE(json.contains("transfers"));
  counters.transfers = TransferCounters();
  counters.transfers->timed_out = 4;
  json = counters_json(counters)["transfers"];
  EXPECT_EQ(json["timed_out"], 4);
  EXPECT_EQ(json["wrong_sequence"], 0);
  EXPECT_EQ(json["dropped_frames"], 3);
}

TEST(Json, ShowsTheOutcomeOfACommandInAProblem) {
  Problem problem{ErrorKind::refused, "O:1,1,9", "the channel does not exist", "channels are 1-4"};
  EXPECT_FALSE(problem_json(problem).contains("outcome"));
  problem.outcome = Outcome::timed_out;
  EXPECT_EQ(problem_json(problem)["outcome"], "timed out");
  EXPECT_FALSE(problem_json(problem).contains("code"));
  problem.outcome = Outcome::refused;
  problem.refusal = Refusal::channel;
  EXPECT_EQ(problem_json(problem)["outcome"], "refused");
  EXPECT_EQ(problem_json(problem)["code"], "CHANNEL");
}

}  // namespace
}  // namespace r4::tool
