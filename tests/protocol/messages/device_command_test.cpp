// SPDX-License-Identifier: GPL-3.0-or-later
#include "protocol/messages/device_command.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <string>

#include "protocol/messages/command_field.hpp"
#include "protocol/messages/settings.hpp"
#include "tests/support/datagrams.hpp"

namespace r4 {
namespace {

using test::str;

// Reads the command in `text` and writes it again. If the command is refused, returns the name of
// the refusal.
std::string device_again(const std::string& text) {
  Field field;
  EXPECT_TRUE(read_field(Text(text), field)) << text;
  Command command = Command::relay(7, true);
  const Refusal refusal = parse_command(field, command);
  if (refusal != Refusal::none) {
    EXPECT_EQ(command.kind, CommandKind::relay) << text << ": a refusal does not change the result";
    return str(name_of(refusal));
  }
  char buffer[max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  write_command(writer, command);
  return std::string(buffer, writer.size());
}

std::string bytes_text(std::size_t count) { return "x" + std::string(2 * count, 'a'); }

TEST(DeviceCommand, IsReadAndWrittenAgain) {
  for (const std::string& text :
       {std::string("X:READ,104,x75,1"), std::string("X:READ,8,x,32"),
        std::string("X:READ,119,x010f,2"), std::string("X:WRITE,104,x6B00"),
        std::string("X:WRITE,104,x75,1"), std::string("X:SCAN"),
        std::string("X:POLL,104,x3B,14,10,1"), std::string("X:POLL,64,x02,2,60000,8"),
        std::string("X:OFF,8"), "X:WRITE,104," + bytes_text(32) + ",32"}) {
    EXPECT_EQ(device_again(text), text);
  }
  EXPECT_EQ(device_again("X:READ,0x68,x75,1"), "X:READ,104,x75,1")
      << "data sheets write addresses in hexadecimal";
}

TEST(DeviceCommand, EachMistakeHasItsRefusalCode) {
  const std::pair<std::string, std::string> wrong[] = {
      {"X:", "FORMAT"},
      {"X:GO", "UNKNOWN"},
      {"X:READ", "FORMAT"},
      {"X:READ,104,x75", "FORMAT"},
      {"X:READ,104,x75,1,1", "FORMAT"},
      {"X:READ,104,75,1", "FORMAT"},
      {"X:READ,104,x7,1", "FORMAT"},
      {"X:READ,104,xgg,1", "FORMAT"},
      {"X:READ,104,,1", "FORMAT"},
      {"X:READ,0x6g,x75,1", "FORMAT"},
      {"X:READ,0x168,x75,1", "RANGE"},
      {"X:READ,7,x75,1", "RANGE"},    // reserved
      {"X:READ,120,x75,1", "RANGE"},  // reserved
      {"X:READ,-1,x75,1", "RANGE"},
      {"X:READ,99999999999,x75,1", "RANGE"},
      {"X:READ,104,x75,0", "RANGE"},
      {"X:READ,104,x75,33", "RANGE"},
      {"X:READ,104,x75,256", "RANGE"},
      {"X:READ,104,x010203,1", "RANGE"},
      {"X:WRITE,104", "FORMAT"},
      {"X:WRITE,104,x", "RANGE"},
      {"X:WRITE,104,x00,0", "RANGE"},
      {"X:WRITE,104,x00,-1", "RANGE"},
      {"X:WRITE,104," + bytes_text(33), "RANGE"},
      {"X:SCAN,1", "FORMAT"},
      {"X:POLL,104,x3B,14,10", "FORMAT"},
      {"X:POLL,104,x3B,14,10,0", "CHANNEL"},
      {"X:POLL,104,x3B,14,10,9", "CHANNEL"},
      {"X:POLL,104,x3B,14,10,257", "CHANNEL"},
      {"X:POLL,3,x3B,14,10,1", "RANGE"},
      {"X:POLL,104,x3B,14,4,1", "RANGE"},
      {"X:POLL,104,x3B,14,60001,1", "RANGE"},
      {"X:POLL,104,x3B,14,65546,1", "RANGE"},
      {"X:POLL,104,x3B,0,10,1", "RANGE"},
      {"X:OFF", "FORMAT"},
      {"X:OFF,0", "CHANNEL"},
      {"X:OFF,9", "CHANNEL"},
      {"X:off,1", "UNKNOWN"},
  };
  for (const auto& [text, code] : wrong) EXPECT_EQ(device_again(text), code) << text;
}

TEST(DeviceCommand, OnlyWritesAndDacDriveOutputsAndOnlyDacJoinsGroups) {
  for (const CommandKind kind : {CommandKind::i2c_write, CommandKind::uart_write}) {
    EXPECT_TRUE(drives_output(kind));
    EXPECT_FALSE(joins_groups(kind));
  }
  EXPECT_TRUE(drives_output(CommandKind::dac));
  EXPECT_TRUE(joins_groups(CommandKind::dac));
  for (const CommandKind kind : {CommandKind::i2c_read, CommandKind::i2c_scan,
                                 CommandKind::i2c_poll, CommandKind::i2c_poll_off}) {
    EXPECT_FALSE(drives_output(kind));
  }
}

TEST(DeviceCommand, AReadingIsKeptAsASetting) {
  Settings settings;
  const auto taken = [&settings](const char* key, const char* value) {
    return str(
        name_of(set(settings, Text(key, std::strlen(key)), Text(value, std::strlen(value)))));
  };
  EXPECT_EQ(taken("i2c1", "0x68:x3B:14:10"), "NONE");
  EXPECT_EQ(taken("i2c8", "64:x:2:60000"), "NONE");
  EXPECT_EQ(taken("i2c9", "off"), "UNKNOWN");
  EXPECT_EQ(taken("i2c0", "off"), "UNKNOWN");
  EXPECT_EQ(taken("i2c2", "104:x3B:14"), "FORMAT");
  EXPECT_EQ(taken("i2c2", "104:x3B:14:10:1"), "FORMAT");
  EXPECT_EQ(taken("i2c2", "7:x3B:14:10"), "RANGE");
  EXPECT_EQ(taken("i2c2", "104:x3B:14:4"), "RANGE");
  EXPECT_FALSE(settings.polls[1].on()) << "a refusal changes nothing";

  char buffer[max_settings_text];
  Text text;
  ASSERT_TRUE(write_settings(settings, buffer, sizeof buffer, text));
  Settings back;
  read_settings(text, back);
  EXPECT_TRUE(back == settings);
  EXPECT_EQ(back.polls[0].address, 0x68);
  EXPECT_EQ(back.polls[0].register_bytes[0], 0x3B);
  EXPECT_EQ(back.polls[7].register_size, 0);
  EXPECT_EQ(taken("i2c1", "off"), "NONE");
  EXPECT_FALSE(settings == back);
}

TEST(UartMode, IsReadAsItIsWritten) {
  for (const char* text : {"off", "1200:8N1", "115200:8E1", "460800:8O2"}) {
    UartMode mode;
    EXPECT_EQ(parse_uart_mode(Text(text, std::strlen(text)), mode), Refusal::none) << text;
    char buffer[max_uart_text];
    const Text written = write_uart_mode(mode, buffer);
    EXPECT_EQ(std::string(written.data(), written.size()), text);
  }
  for (const char* text :
       {"", ":8N1", "115200", "115200:8X1", "115200:9N1", "115200:8N0", "-1:8N1x"}) {
    UartMode mode;
    EXPECT_EQ(parse_uart_mode(Text(text, std::strlen(text)), mode), Refusal::format) << text;
  }
  for (const char* text : {"0:8N1", "460801:8N1", "99999999999:8N1"}) {
    UartMode mode;
    EXPECT_EQ(parse_uart_mode(Text(text, std::strlen(text)), mode), Refusal::range) << text;
  }
}

}  // namespace
}  // namespace r4
