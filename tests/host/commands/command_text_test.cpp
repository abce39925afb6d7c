// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/commands/command_text.hpp"

#include <gtest/gtest.h>

#include <set>
#include <string>
#include <utility>

#include "r4link/key.hpp"

namespace r4::test {
namespace {

TEST(CommandText, ParsesWritesAndDescribesEveryKind) {
  const struct {
    std::string text;
    std::string words;
  } cases[] = {
      {"O:358,1,1", "OSMC 1 forward, duty 0.087"},
      {"O:0,0,4", "OSMC 4 reverse, duty 0"},
      {"D:4095,0,2", "DHB12 2 reverse, duty 1"},
      {"S:1500,3", "servo 3 at 1500 us"},
      {"S:0,16", "servo 16 off"},
      {"R:1,On", "relay 1 on"},
      {"R:8,Off", "relay 8 off"},
      {"P:-5,1000,2", "stepper 2 to -5 steps at 1000 steps/s"},
      {"Z:4", "encoder and stepper 4 to zero"},
      {"B:410,1,0,1", "BLDC 1 forward, duty 0.1"},
      {"B:0,1,1,1", "BLDC 1 forward, duty 0, brake on"},
      {"X:DAC,1,1650", "DAC 1 at 1650 mV"},
      {"X:WRITE,104,x6B00", "write x6B00 to I2C device 0x68"},
      {"X:WRITE,8,x75,1", "write x75 to I2C device 0x08, then read 1 byte"},
      {"X:UART,1,x4142", "write x4142 to UART 1"},
      {"X:READ,104,x3B,14", "read 14 bytes at x3B of I2C device 0x68"},
      {"X:READ,104,x,1", "read 1 byte of I2C device 0x68"},
      {"X:SCAN", "scan the user I2C bus"},
      {"X:POLL,104,x3B,14,10,2", "reading 2: read 14 bytes at x3B of I2C device 0x68 every 10 ms"},
      {"X:OFF,2", "reading 2 off"},
      {"U:50,1", "proximity sensor 1 below 50 cm"},
      {"U:0,1", "proximity sensor 1 off"},
      {"H:ROS2-R4", "host heartbeat"},
      {"E:STOP", "stop every output"},
      {"E:CLEAR", "clear the safe state"},
      {"E:CLEAR,7", "clear cause 7"},
      {"E:LEAVE", "end control"},
      {"F:DEFAULT,ENC1", "send fields DEFAULT,ENC1"},
      {"C:rate,50", "setting rate 50"},
      {"C:key,1:off", "setting key 1:off"},
      {"Q:ID", "ask who the board is"},
      {"Q:WIRING", "ask how the board is wired"},
      {"W:0", "stop watching"},
      {"W:10", "watch at 10 Hz"},
      {"W:10,ENC1,ENC2", "watch at 10 Hz, fields ENC1,ENC2"},
  };
  std::set<CommandKind> kinds;
  for (const auto& c : cases) {
    const OwnCommand command = parse_command_text(c.text + ";");
    EXPECT_EQ(to_text(command), c.text);
    EXPECT_EQ(describe(command), c.words);
    kinds.insert(Command(command).kind);
  }
  EXPECT_EQ(kinds.size(), static_cast<std::size_t>(CommandKind::watch) + 1)
      << "every kind of command must be tested";
}

TEST(CommandText, AParsedCommandOutlivesItsText) {
  std::string text = "C:name,a-name-that-is-longer-than-most";
  OwnCommand parsed = parse_command_text(text);
  text.assign(text.size(), '!');
  const OwnCommand taken = std::move(parsed);
  const OwnCommand copy = taken;
  EXPECT_EQ(to_text(copy), "C:name,a-name-that-is-longer-than-most");
  EXPECT_EQ(to_text(taken), to_text(copy));
}

TEST(CommandText, MasksKeysAndPasswords) {
  const std::string digits(2 * key_size, 'e');
  const struct {
    std::string text;
    std::string shown;
  } cases[] = {
      {"C:key,3:" + digits, "C:key,3:..."},
      {"C:key,3:off", "C:key,3:off"},
      {"C:key," + digits, "C:key,..."},
      {"C:key," + digits + ":3", "C:key,..."},
      {"C:key=3:" + digits, "C:key=3:..."},
      {"C:3:" + digits, "C:3:..."},
      {"C:Key,3:" + digits, "C:Key,..."},
      {"C:password,letmein!", "C:password,..."},
      {"C:pasword,letmein!", "C:pasword,..."},
      {"C:password", "C:password"},
      {"C:network,letmein!", "C:network,letmein!"},
      {"C:rate,50", "C:rate,50"},
      {"C:rate,100000", "C:rate,100000"},
      {"O:358,1,1", "O:358,1,1"},
  };
  for (const auto& c : cases) {
    EXPECT_EQ(shown(c.text), c.shown);
    EXPECT_EQ(shown(c.shown), c.shown) << "a shown text must be shown unchanged";
  }
  const OwnCommand key = parse_command_text("C:key,3:" + digits);
  EXPECT_EQ(shown(key), "C:key,3:...");
  EXPECT_EQ(describe(key), "setting key 3:...");
  EXPECT_EQ(describe(Command::setting("rate", "5;0")), "setting ")
      << "no datagram can carry this value";
}

}  // namespace
}  // namespace r4::test
