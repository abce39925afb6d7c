// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/r4/formats/json_lines.hpp"

#include <gtest/gtest.h>

#include <sstream>

#include "converted.hpp"

namespace r4::test {
namespace {

TEST(JsonLines, HasAnObjectForEachRecord) {
  const Converted result = converted(recorded_capture(), ".r4log", ".jsonl");
  EXPECT_EQ(result.left_out, "");
  std::vector<tool::Json> objects;
  std::istringstream stream(result.bytes);
  for (std::string line; std::getline(stream, line);) objects.push_back(tool::Json::parse(line));
  ASSERT_EQ(objects.size(), paper_capture().size() + 2);
  EXPECT_EQ(objects[0].dump(),
            R"({"time":1795468293.404765,"path":1,"board":"left-arm","type":"event",)"
            R"("event":"up udp://192.168.0.125"})");
  EXPECT_EQ(objects[1]["type"], "state");
  EXPECT_EQ(objects[1]["fields"]["AIN24"], 24.28);
  EXPECT_EQ(objects[1]["fields"]["DHB1A"], (tool::Json{4095, 1}));
  EXPECT_EQ(objects[1]["text"], paper_capture()[0].bytes);
  EXPECT_EQ(objects.back().dump(),
            R"({"time":1795468294.114765,"path":0,"type":"event","event":"end"})");
  const auto bad = std::count_if(objects.begin(), objects.end(), [](const tool::Json& each) {
    return each.value("error", "") == "crc" && each["ok"] == false;
  });
  EXPECT_EQ(bad, 2);
}

TEST(JsonLines, AreValidForAnyBytes) {
  std::istringstream stream(converted(generated_recording(2, 2000), ".r4log", ".jsonl").bytes);
  int count = 0;
  for (std::string line; std::getline(stream, line); ++count) {
    EXPECT_TRUE(tool::Json::accept(line)) << line;
  }
  EXPECT_EQ(count, 2000);
}

}  // namespace
}  // namespace r4::test
