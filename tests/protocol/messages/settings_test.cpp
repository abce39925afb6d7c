// SPDX-License-Identifier: GPL-3.0-or-later
#include "protocol/messages/settings.hpp"

#include <gtest/gtest.h>

#include <string>

#include "tests/support/datagrams.hpp"

namespace r4 {
namespace {

using test::str;

Refusal set_text(Settings& settings, const std::string& key, const std::string& value) {
  return set(settings, key, value);
}

TEST(Settings, DefaultsMatchThePaperAndPackIsOn) {
  const Settings settings;
  EXPECT_EQ(settings.state_rate_hz, 100);
  EXPECT_EQ(settings.heartbeat_ms, 500);
  EXPECT_EQ(settings.timeout_ms, 1000);
  EXPECT_EQ(settings.recovery, Recovery::last);
  EXPECT_TRUE(settings.pack);
}

TEST(Settings, AcceptsNumbersOnlyWithinTheirRange) {
  struct Case {
    const char* key;
    int min;
    int max;
    std::uint16_t Settings::*member;
  };
  for (const Case& c : {Case{"rate", 1, 1000, &Settings::state_rate_hz},
                        Case{"heartbeat", 50, 1000, &Settings::heartbeat_ms},
                        Case{"timeout", 100, 10000, &Settings::timeout_ms}}) {
    Settings settings;
    settings.heartbeat_ms = 60;   // less than the smallest timeout
    settings.timeout_ms = 10000;  // longer than the largest heartbeat interval
    for (const int value : {c.min, c.max}) {
      EXPECT_EQ(set_text(settings, c.key, std::to_string(value)), Refusal::none) << c.key;
      EXPECT_EQ(settings.*c.member, value) << c.key;
    }
    for (const std::string& value :
         {std::to_string(c.min - 1), std::to_string(c.max + 1), std::string("-5"),
          std::string("65636"), std::string("99999999999999999999")}) {
      EXPECT_EQ(set_text(settings, c.key, value), Refusal::range) << c.key << ' ' << value;
    }
    for (const std::string value : {"", "x", "+5", " 5", "5.0", "5ms"}) {
      EXPECT_EQ(set_text(settings, c.key, value), Refusal::format) << c.key << ' ' << value;
    }
    EXPECT_EQ(settings.*c.member, c.max) << c.key << " changed by a refusal";
  }
}

TEST(Settings, TheHeartbeatIntervalStaysBelowTheTimeout) {
  Settings settings;
  EXPECT_EQ(set_text(settings, "timeout", "500"), Refusal::range);
  EXPECT_EQ(set_text(settings, "timeout", "501"), Refusal::none);
  EXPECT_EQ(set_text(settings, "heartbeat", "501"), Refusal::range);
  EXPECT_EQ(set_text(settings, "heartbeat", "500"), Refusal::none);
  EXPECT_EQ(settings.heartbeat_ms, 500);
  EXPECT_EQ(settings.timeout_ms, 501);
}

TEST(Settings, RecoveryIsEitherLastOrRearm) {
  Settings settings;
  EXPECT_EQ(set_text(settings, "recovery", "rearm"), Refusal::none);
  EXPECT_EQ(settings.recovery, Recovery::rearm);
  for (const std::string value : {"", "Last", "1", "rearm "}) {
    EXPECT_EQ(set_text(settings, "recovery", value), Refusal::format) << value;
  }
  EXPECT_EQ(settings.recovery, Recovery::rearm);
  EXPECT_EQ(set_text(settings, "recovery", "last"), Refusal::none);
  EXPECT_EQ(settings.recovery, Recovery::last);
}

TEST(Settings, PackIsSwitchedOffAndOn) {
  Settings settings;
  EXPECT_EQ(set_text(settings, "pack", "0"), Refusal::none);
  EXPECT_FALSE(settings.pack);
  for (const std::string value : {"2", "-1", "99999999999999999999"}) {
    EXPECT_EQ(set_text(settings, "pack", value), Refusal::range) << value;
  }
  for (const std::string value : {"", "on", "1.0", "+1"}) {
    EXPECT_EQ(set_text(settings, "pack", value), Refusal::format) << value;
  }
  EXPECT_FALSE(settings.pack);
  EXPECT_EQ(set_text(settings, "pack", "1"), Refusal::none);
  EXPECT_TRUE(settings.pack);
}

TEST(Settings, OtherKeysAreUnknown) {
  Settings settings;
  for (const std::string key : {"", "Rate", "rates", "timeout ", "PACK"}) {
    EXPECT_EQ(set_text(settings, key, "100"), Refusal::unknown) << key;
  }
}

// If operator== or the storage omits a setting, the next start of a Giga loses the setting.
TEST(Settings, EachSettingIsComparedAndStored) {
  char wiring[max_wiring_value];
  const std::string values[] = {"60",
                                "2000",
                                "2",
                                "rearm",
                                "0",
                                "9600:8E1",
                                "40:x00:1:100",
                                "somewhere",
                                "192.168.0.2",
                                "1:" + std::string(64, 'a'),
                                str(write_wiring_value(Wiring(), wiring))};
  for (const SettingRow& row : setting_rows) {
    bool found = false;
    for (const std::string& value : values) {
      Settings changed;
      if (set(changed, row.key, value) != Refusal::none || changed == Settings()) continue;
      found = true;
      char text[max_settings_text];
      Text written;
      ASSERT_TRUE(write_settings(changed, text, sizeof text, written)) << str(row.key);
      Settings again;
      read_settings(written, again);
      EXPECT_EQ(again, changed) << str(row.key) << " is not stored";
    }
    EXPECT_TRUE(found) << str(row.key) << ": no value changes it, or operator== forgets it";
  }
}

}  // namespace
}  // namespace r4
