// SPDX-License-Identifier: GPL-3.0-or-later
#include "host/commands/command_help.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <regex>
#include <string>

#include "r4link/commands/command_text.hpp"
#include "r4link/key.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

TEST(CommandHelp, ReportsAnInvalidSecretWithoutShowingIt) {
  const std::string secret(2 * key_size - 1, 'e');
  for (const std::string& text : {"C:key,3:" + secret, "C:key," + secret, "C:kee,3:" + secret,
                                  "C:password," + secret + "e", "C:pass," + secret}) {
    const std::string said = problem_of([&] { parse_command_text(text); }).text();
    EXPECT_EQ(said.find("eeee"), std::string::npos) << said;
    EXPECT_EQ(said.substr(0, 3), "C:" + text.substr(2, 1)) << said;
  }
  const std::string said =
      problem_of([&] { require_valid(Command::setting("", Text(secret))); }).text();
  EXPECT_EQ(said.find("eeee"), std::string::npos) << said;
  const Problem problem = bad_command("C:key,3:" + secret, Refusal::format);
  EXPECT_EQ(problem.thing, "C:key,3:...");
  EXPECT_NE(problem.fix.find("64 hexadecimal digits"), std::string::npos) << problem.fix;
}

TEST(CommandHelp, AllowsASecretOnlyOverACable) {
  const Command secret = Command::setting("password", "eeeeeeee");
  for (const char* url : {"serial:auto", "serial:///dev/ttyACM0", "sim:", "memory:"}) {
    EXPECT_NO_THROW(require_cable(url, secret)) << url;
  }
  for (const char* url :
       {"udp://192.168.4.1", "can://can0?node=3", "UDP://192.168.4.1", "both:", ""}) {
    EXPECT_TRUE(contains(problem_of([&] { require_cable(url, secret); }).text(), "over USB only"));
    EXPECT_NO_THROW(require_cable(url, Command::setting("rate", "100"))) << url;
  }
}

TEST(CommandHelp, ShowsTheValidValuesOfASetting) {
  EXPECT_NE(bad_command("C:rate,0", Refusal::range).fix.find("1-1000"), std::string::npos);
  EXPECT_NE(bad_command("C:AINSTEER,x", Refusal::range).fix.find("volts"), std::string::npos);
  const std::string all = bad_command("C:colour,1", Refusal::unknown).fix;
  Text key;
  Text value;
  char buffer[max_site_value];
  for (int i = 0; get(SiteSettings(), i, key, buffer, value); ++i) {
    const std::string name(key.data(), key.size());
    EXPECT_TRUE(all.find(" " + name + " ") != std::string::npos || name.starts_with("AIN")) << name;
  }
}

// Section 3 of docs/reference/protocol.md has a row for each kind of command, with the form and the
// ranges of the command tables.
TEST(CommandHelp, HasTheFormsAndRangesOfTheDocumentedProtocol) {
  std::ifstream file(R4_TEST_DATA "/../../docs/reference/protocol.md");
  std::map<std::string, std::string> documented;
  for (std::string line; std::getline(file, line);) {
    std::smatch parts;
    static const std::regex row(R"(\| `([A-Z]:.*?)` \| .* \| ?(.*?) ?\|)");
    if (!std::regex_match(line, parts, row)) continue;
    documented[std::regex_replace(parts.str(1), std::regex(R"(\\\|)"), "|")] = parts.str(2);
  }
  for (const CommandHelp& each : all_command_help()) {
    ASSERT_EQ(documented.count(each.form), 1U) << each.form;
    if (each.kind == CommandKind::setting) continue;  // settings have separate tables
    EXPECT_EQ(documented[each.form], each.ranges) << each.form;
  }
  EXPECT_EQ(documented.size(), all_command_help().size()) << "a documented row has no command";
}

// The tables of settings on the same page have the range and the default of each setting.
TEST(CommandHelp, TakesTheDocumentedSettings) {
  std::ifstream file(R4_TEST_DATA "/../../docs/reference/protocol.md");
  std::map<std::string, std::string> documented;
  for (std::string line; std::getline(file, line);) {
    std::smatch parts;
    static const std::regex row(R"(\| `([A-Za-z0-9]+)`.* \| .* \| .* \|)");
    if (std::regex_match(line, parts, row)) documented[parts.str(1)] = line;
  }
  for (const SettingRow& row : setting_rows) {
    const std::string key(row.key.data(), row.key.size());
    ASSERT_EQ(documented.count(key), 1U) << key;
    const std::string& line = documented[key];
    const bool volts = row.setting == Setting::full_scale;
    const bool flag = row.setting == Setting::pack;
    if (row.max != 0 && !flag) {
      const std::string range =
          volts ? "0.01–650" : std::to_string(row.min) + "–" + std::to_string(row.max);
      EXPECT_TRUE(contains(line, range)) << key;
    }
    if (row.standard == 0) continue;
    EXPECT_TRUE(contains(line, volts ? "| 50.00 |" : "| " + std::to_string(row.standard) + " |"));
  }
}

TEST(CommandHelp, ShowsTheCommandThatAnInvalidTextBeginsWith) {
  EXPECT_EQ(bad_command("X:DAC,3,1", Refusal::channel).fix,
            "use X:DAC,channel,mV with channel 1-2, mV 0-3300");
  EXPECT_EQ(bad_command("E:GO", Refusal::unknown).fix, "use E:STOP, E:CLEAR[,cause], E:LEAVE");
  EXPECT_EQ(bad_command("E:STOP,1", Refusal::format).fix, "use E:STOP");
  EXPECT_TRUE(contains(bad_command("G:1", Refusal::unknown).fix, "use one of O:pwm,dir,ch D:"));
}

}  // namespace
}  // namespace r4::test
