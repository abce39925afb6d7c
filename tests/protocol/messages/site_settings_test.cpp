// SPDX-License-Identifier: GPL-3.0-or-later
#include "protocol/messages/site_settings.hpp"

#include <gtest/gtest.h>

#include <string>

#include "protocol/messages/settings.hpp"
#include "tests/support/datagrams.hpp"

namespace r4 {
namespace {

Refusal set_text(SiteSettings& settings, const std::string& key, const std::string& value) {
  const FoundSetting found = find_setting(Text(key));
  return found.row == nullptr ? Refusal::unknown : set(settings, found, Text(value));
}

std::string written(const Settings& settings) {
  char buffer[max_settings_text];
  Text text;
  EXPECT_TRUE(write_settings(settings, buffer, sizeof buffer, text));
  return std::string(text.data(), text.size());
}

TEST(SiteSettings, ANetworkIsSetWithItsPassword) {
  SiteSettings settings;
  EXPECT_STREQ(settings.network, "");
  EXPECT_EQ(set_text(settings, "network", "My Net"), Refusal::none);
  EXPECT_EQ(set_text(settings, "password", "p%2Cq%3Br%5e%25s t"), Refusal::none);
  EXPECT_STREQ(settings.network, "My Net");
  EXPECT_STREQ(settings.password, "p,q;r^%s t");
}

TEST(SiteSettings, AnotherNetworkForgetsThePassword) {
  SiteSettings settings;
  set_text(settings, "network", "one");
  set_text(settings, "password", "12345678");
  EXPECT_EQ(set_text(settings, "network", "one"), Refusal::none);
  EXPECT_STREQ(settings.password, "12345678");
  EXPECT_EQ(set_text(settings, "network", "two"), Refusal::none);
  EXPECT_STREQ(settings.password, "");
}

TEST(SiteSettings, OffMeansNoNetworkUnlessItIsEscaped) {
  SiteSettings settings;
  set_text(settings, "network", "one");
  EXPECT_EQ(set_text(settings, "network", "off"), Refusal::none);
  EXPECT_STREQ(settings.network, "");
  EXPECT_EQ(set_text(settings, "network", "%6Fff"), Refusal::none);
  EXPECT_STREQ(settings.network, "off");
}

TEST(SiteSettings, AcceptsValidFormsAndRefusesInvalidForms) {
  struct Case {
    const char* key;
    std::string value;
    Refusal refusal;
  };
  const Case cases[] = {
      {"network", std::string(32, 'n'), Refusal::none},
      {"network", std::string(33, 'n'), Refusal::range},
      {"network", "%", Refusal::format},
      {"network", "%4", Refusal::format},
      {"network", "%4g", Refusal::format},
      {"network", "a%00", Refusal::format},
      {"password", "1234567", Refusal::range},
      {"password", "12345678", Refusal::none},
      {"password", std::string(63, 'p'), Refusal::none},
      {"password", std::string(64, 'p'), Refusal::range},
      {"password", "off", Refusal::none},
      {"host", "192.168.0.117", Refusal::none},
      {"host", "off", Refusal::none},
      {"host", "192.168.0", Refusal::format},
      {"host", "192.168.0.1.1", Refusal::format},
      {"host", "192.168.0.256", Refusal::range},
      {"host", "192.168..1", Refusal::format},
      {"host", "name", Refusal::format},
      {"port", "1", Refusal::none},
      {"port", "65535", Refusal::none},
      {"port", "0", Refusal::range},
      {"port", "65536", Refusal::range},
      {"port", "x", Refusal::format},
      {"node", "0", Refusal::none},
      {"node", "31", Refusal::none},
      {"node", "32", Refusal::range},
      {"name", "a", Refusal::none},
      {"name", "left-Arm_2", Refusal::none},
      {"name", std::string(31, 'n'), Refusal::none},
      {"name", "off", Refusal::none},
      {"name", std::string(32, 'n'), Refusal::range},
      {"name", std::string(300, 'n'), Refusal::range},
      {"name", std::string(300, '.'), Refusal::format},
      {"name", "left arm", Refusal::format},
      {"name", "%6Ceft", Refusal::format},
      {"name", "l\xc3\xa4nge", Refusal::format},
      {"AIN24", "51.66", Refusal::none},
      {"AIN6", "650", Refusal::none},
      {"AIN6", "650.01", Refusal::range},
      {"AIN6", "0", Refusal::range},
      {"AIN6", "-1", Refusal::range},
      {"AIN6", "V", Refusal::format},
      {"key", "1:" + std::string(64, 'f'), Refusal::none},
      {"key", "9:" + std::string(64, '0'), Refusal::none},
      {"key", "1:off", Refusal::none},
      {"key", "0:" + std::string(64, '0'), Refusal::range},
      {"key", "10:off", Refusal::range},
      {"key", "1:" + std::string(63, '0'), Refusal::format},
      {"key", "1:" + std::string(65, '0'), Refusal::format},
      {"key", "1:Off", Refusal::format},
      {"key", "off", Refusal::format},
      {"OSMC1", "1", Refusal::unknown},
      {"Network", "x", Refusal::unknown},
  };
  for (const Case& c : cases) {
    SiteSettings settings;
    SiteSettings before = settings;
    EXPECT_EQ(set_text(settings, c.key, c.value), c.refusal) << c.key << ' ' << c.value;
    if (c.refusal != Refusal::none) {
      EXPECT_TRUE(settings == before) << c.key << ' ' << c.value;
    }
  }
}

TEST(SiteSettings, ANameCanBeReplacedAndRemoved) {
  SiteSettings settings;
  EXPECT_STREQ(settings.name, "");
  set_text(settings, "name", "a-long-name");
  set_text(settings, "name", "b");
  SiteSettings other;
  set_text(other, "name", "b");
  EXPECT_STREQ(settings.name, "b");
  EXPECT_TRUE(settings == other);
  EXPECT_EQ(set_text(settings, "name", "off"), Refusal::none);
  EXPECT_STREQ(settings.name, "");
  EXPECT_FALSE(settings == other);
}

TEST(SiteSettings, HoldFourKeysAndReplaceOneOfTheSameId) {
  SiteSettings settings;
  for (const char id : {'3', '1', '9', '4'}) {
    EXPECT_EQ(set_text(settings, "key", std::string(1, id) + ":" + std::string(64, id)),
              Refusal::none);
  }
  EXPECT_EQ(set_text(settings, "key", "5:" + std::string(64, '5')), Refusal::range);
  EXPECT_EQ(set_text(settings, "key", "1:" + std::string(64, 'e')), Refusal::none);
  EXPECT_EQ(settings.keys[1].id, 1);
  EXPECT_EQ(settings.keys[1].bytes[0], 0xEE);
  EXPECT_EQ(set_text(settings, "key", "3:off"), Refusal::none);
  EXPECT_EQ(settings.keys[0].id, 1);
  EXPECT_EQ(settings.keys[2].id, 4);
  EXPECT_TRUE(settings.keys[3] == Key()) << "the whole key is erased";
  EXPECT_EQ(set_text(settings, "key", "3:off"), Refusal::none);
  EXPECT_EQ(set_text(settings, "key", "5:" + std::string(64, '5')), Refusal::none);
}

TEST(SiteSettings, PasswordAndKeysAreSecret) {
  EXPECT_TRUE(is_secret_setting("password"));
  EXPECT_TRUE(is_secret_setting("key"));
  EXPECT_FALSE(is_secret_setting("network"));
  EXPECT_FALSE(is_secret_setting("AIN24"));
  EXPECT_FALSE(is_secret_setting("other"));
}

TEST(SiteSettings, AreDistinguishedFromOtherSettings) {
  for (const char* key :
       {"network", "password", "host", "port", "node", "name", "wiring", "AINDMH", "key"}) {
    EXPECT_TRUE(is_site_setting(Text(key, std::string(key).size()))) << key;
  }
  for (const char* key : {"rate", "heartbeat", "timeout", "recovery", "pack", "DMHSTA", ""}) {
    EXPECT_FALSE(is_site_setting(Text(key, std::string(key).size()))) << key;
  }
}

TEST(KeptSettings, RoundTripThroughText) {
  Settings settings;
  settings.state_rate_hz = 50;
  settings.heartbeat_ms = 1000;
  settings.timeout_ms = 1500;
  settings.recovery = Recovery::rearm;
  settings.pack = false;
  set_text(settings.site, "network", "off, really: 100%25^;%01");
  set_text(settings.site, "password", "%ff%fe%fd%fc%fb%fa%f9%f8");
  set_text(settings.site, "host", "10.0.200.255");
  set_text(settings.site, "port", "2019");
  set_text(settings.site, "node", "7");
  set_text(settings.site, "name", "left-arm");
  set_text(settings.site, "AINSTEER", "3.3");
  set_text(settings.site, "key", "2:00ff" + std::string(60, 'a'));
  set_text(settings.site, "key", "1:" + std::string(64, 'b'));
  Settings back;
  read_settings(Text(written(settings)), back);
  EXPECT_TRUE(back == settings) << written(back);
  EXPECT_EQ(back.heartbeat_ms, 1000) << "heartbeat_ms is valid only after timeout_ms is set";
}

TEST(KeptSettings, KeepTheirValuesInAFirmwareWithOtherDefaults) {
  Settings back;
  read_settings("rate,50\nrecovery,last\npack,0\n", back);
  EXPECT_FALSE(back.pack);
  EXPECT_EQ(back.state_rate_hz, 50);
  read_settings("rate,50\n", back = Settings());
  EXPECT_TRUE(back.pack) << "the text comes from a firmware without this setting";
}

TEST(KeptSettings, TheLongestSettingsFit) {
  Settings settings;
  settings.state_rate_hz = 1000;
  settings.timeout_ms = 10000;
  settings.heartbeat_ms = 1000;
  settings.recovery = Recovery::rearm;
  std::string name;
  std::string password;
  for (std::size_t i = 0; i < network_max; ++i) name += "%ff";
  for (std::size_t i = 0; i < password_max; ++i) password += "%ff";
  set_text(settings.site, "network", name);
  set_text(settings.site, "password", password);
  set_text(settings.site, "host", "255.255.255.255");
  set_text(settings.site, "port", "65535");
  set_text(settings.site, "node", "31");
  for (int slot = 1; slot <= i2c_slots; ++slot) {
    EXPECT_EQ(set(settings, "i2c" + std::to_string(slot), std::string("119:xffff:32:60000")),
              Refusal::none);
  }
  for (int uart = 1; uart <= uart_channels; ++uart) {
    EXPECT_EQ(set(settings, "uart" + std::to_string(uart), std::string("460800:8N1")),
              Refusal::none);
  }
  set_text(settings.site, "name", std::string(board_name_max, 'n'));
  settings.site.wiring_source = WiringSource::given;
  for (std::uint16_t& full_scale : settings.site.full_scale_cv) full_scale = 65000;
  for (const char id : {'1', '2', '3', '4'}) {
    set_text(settings.site, "key", std::string(1, id) + ":" + std::string(64, 'f'));
  }
  Settings back;
  read_settings(Text(written(settings)), back);
  EXPECT_TRUE(back == settings);
  char small[100];
  Text text;
  EXPECT_FALSE(write_settings(settings, small, sizeof small, text));
}

TEST(SiteSettings, AWiringIsGivenReplacedAndForgotten) {
  SiteSettings settings;
  EXPECT_EQ(settings.wiring_source, WiringSource::plan);
  EXPECT_EQ(settings.wiring, plan_wiring());
  Wiring wiring = plan_wiring();
  wiring.at(SignalKind::handle).byte = 53;
  char value[max_wiring_value];
  EXPECT_EQ(set_text(settings, "wiring", test::str(write_wiring_value(wiring, value))),
            Refusal::none);
  EXPECT_EQ(settings.wiring_source, WiringSource::given);
  EXPECT_EQ(settings.wiring, wiring);
  wiring.at(SignalKind::handle).byte = 20;
  EXPECT_EQ(set_text(settings, "wiring", test::str(write_wiring_value(wiring, value))),
            Refusal::range);
  EXPECT_EQ(set_text(settings, "wiring", "1:00"), Refusal::format);
  EXPECT_EQ(settings.wiring.at(SignalKind::handle).number(), 53) << "it keeps the one it had";
  EXPECT_EQ(set_text(settings, "wiring", "off"), Refusal::none);
  EXPECT_TRUE(settings == SiteSettings());
}

TEST(KeptSettings, ADamagedWiringIsNotGuessed) {
  Settings settings;
  settings.site.wiring_source = WiringSource::given;
  const std::string text = written(settings);
  const std::size_t first = text.find("\nwiring,1:");
  ASSERT_NE(first, std::string::npos);
  Settings read;
  for (std::size_t at = first; at <= text.find('\n', first + 1); ++at) {
    std::string damaged = text;
    damaged[at] = static_cast<char>(damaged[at] ^ 1);
    read_settings(Text(damaged), read = Settings());
    EXPECT_EQ(read.site.wiring_source, WiringSource::damaged) << damaged;
    EXPECT_EQ(read.site.wiring, Wiring()) << "nothing is connected";
  }
  Settings again;
  read_settings(Text(written(read)), again);
  EXPECT_EQ(again.site.wiring_source, WiringSource::damaged) << "until another is given";
  read_settings(Text(text), read);
  EXPECT_TRUE(read == settings);
}

TEST(KeptSettings, AMissingWiringIsNotGuessed) {
  const std::string texts[] = {"", "rate,50\n", "rate,50\nwirinh,off\n"};
  for (const std::string& text : texts) {
    Settings read;
    read_settings(Text(text), read);
    EXPECT_EQ(read.site.wiring_source, WiringSource::damaged) << text;
  }
}

TEST(KeptSettings, UnknownLinesAreSkipped) {
  Settings settings;
  read_settings("rate,50\nfuture,1\nnonsense\n\n,\ntimeout,99\nnode,3", settings);
  EXPECT_EQ(settings.state_rate_hz, 50);
  EXPECT_EQ(settings.timeout_ms, 1000);
  EXPECT_EQ(settings.site.can_node, 3);
}

}  // namespace
}  // namespace r4
