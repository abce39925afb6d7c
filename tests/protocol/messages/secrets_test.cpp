// SPDX-License-Identifier: GPL-3.0-or-later
// Finds the secret in a setting, and removes secrets from datagrams.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <string>
#include <vector>

#include "protocol/messages/settings.hpp"
#include "r4link/datagram.hpp"
#include "r4link/key.hpp"
#include "r4link/messages/message.hpp"
#include "tests/support/datagrams.hpp"

namespace r4::test {
namespace {

const std::string secret_digits(2 * key_size, 'e');

std::string masked(const std::string& bytes) {
  std::string room(bytes.size() + masking_room, '?');
  return str(without_secrets(Text(bytes), room.data()));
}

TEST(Secrets, AreTheDigitsOfAKeyAndAPassword) {
  EXPECT_EQ(str(secret_in(Text("C:key,3:" + secret_digits))), secret_digits);
  EXPECT_EQ(str(secret_in("C:password,letmein!")), "letmein!");
  EXPECT_EQ(str(secret_in("C:key,3:off")), "");
  EXPECT_EQ(str(secret_in("C:network,letmein!")), "");
  EXPECT_EQ(str(secret_in("C:rate,50")), "");
  EXPECT_EQ(str(secret_in("C:password")), "");
  EXPECT_EQ(str(secret_in("O:358,1,1")), "");
  EXPECT_EQ(str(secret_in("")), "");
}

TEST(Secrets, AreFoundAfterAMisspelledName) {
  for (const char* command :
       {"C:pasword,letmein!", "C:Key,letmein!", "C:password=letmein!", "C:key,letmein!"}) {
    EXPECT_EQ(str(secret_in(Text(std::string(command)))), "letmein!") << command;
  }
}

TEST(Secrets, AreReplacedInADatagramThatStaysValid) {
  for (const std::string& end :
       {std::string("PNum:66;T:79146;"), std::string("PNum:1;T:2;A:3,17,79146,AbCdEfGhIjK;")}) {
    EXPECT_EQ(masked(with_crc("C:key,3:" + secret_digits + ";" + end)),
              with_crc("C:key,3:...;" + end));
    EXPECT_EQ(masked(with_crc("C:password,letmein!;" + end)), with_crc("C:password,...;" + end));
    EXPECT_EQ(masked(with_crc("X:1;C:password,letmein!;C:key,1:" + secret_digits + ";" + end)),
              with_crc("X:1;C:password,...;C:key,1:...;" + end));
  }
  const std::string once = masked(with_crc("C:password,letmein!;PNum:1;T:2;"));
  EXPECT_EQ(masked(once), once);
}

TEST(Secrets, MaskingLeavesOtherDatagramsUnchanged) {
  for (const std::string& bytes :
       {captured_state(), with_crc("C:rate,50;PNum:1;T:2;"), with_crc("C:key,3:off;PNum:1;T:2;"),
        with_crc("X:C:key,1;PNum:1;T:2;"), with_crc("CC:password,letmein!;PNum:1;"),
        std::string("C:rate,50;PNum:1;^0x0^"), std::string("\x80\0C", 3), std::string("C:"),
        std::string()}) {
    std::string room(bytes.size() + masking_room, '?');
    EXPECT_EQ(without_secrets(Text(bytes), room.data()).data(), bytes.data()) << bytes;
  }
}

// The checksum of a damaged datagram could confirm a guess of the secret.
TEST(Secrets, AreReplacedWithTheRestOfADamagedDatagram) {
  std::string damaged = with_crc("C:password,letmein!;PNum:66;T:79146;");
  damaged[15] = '\x07';
  EXPECT_EQ(masked(damaged), "C:password,...");
  EXPECT_EQ(masked("1;^0x12^C:key,1:" + secret_digits), "1;^0x12^C:key,1:...");
  EXPECT_EQ(masked("noiseC:password,letmein!"), "noiseC:password,...");
  EXPECT_EQ(masked(masked(damaged)), masked(damaged));
}

RC_GTEST_PROP(Secrets, AreGoneTheFirstTime, (bool is_valid)) {
  const auto pieces = *rc::gen::container<std::vector<std::string>>(
      rc::gen::element<std::string>("C:", "key", "password", ",", "1:", ";", "^", "0x1",
                                    "C:password,letmein!", "rate,50", "...", "off", "x"));
  std::string bytes;
  for (const std::string& each : pieces) bytes += each;
  if (is_valid) bytes = with_crc(bytes);
  const std::string once = masked(bytes);
  RC_ASSERT(masked(once) == once);
  RC_ASSERT(once.size() <= bytes.size() + masking_room);
  RC_ASSERT((";" + once).find(";C:password,letmein!") == std::string::npos);
}

TEST(Secrets, MaskingStaysWithinItsExtraRoom) {
  // The secret has one character. The new checksum has more digits than the original checksum.
  for (int i = 0; i < 2000; ++i) {
    const std::string bytes = with_crc("C:x,1;PNum:" + std::to_string(i) + ";");
    const std::string result = masked(bytes);
    EXPECT_EQ(result.substr(0, 6), "C:x,.;");
    EXPECT_LE(result.size(), bytes.size() + masking_room);
    Datagram datagram;
    EXPECT_TRUE(read_datagram(Text(result), datagram)) << result;
  }
}

}  // namespace
}  // namespace r4::test
