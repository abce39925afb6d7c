// SPDX-License-Identifier: GPL-3.0-or-later
#include "protocol/keys/authentication.hpp"

#include <gtest/gtest.h>

#include <set>
#include <string>

#include "tests/support/datagrams.hpp"
#include "tests/support/signing.hpp"

namespace r4 {
namespace {

using test::key_of;
using test::str;
using test::with_crc;
using test::with_signature;

const std::string fields = "O:358,1,1;PNum:2147484648;T:1699276044383;";
constexpr std::uint32_t now = 79'146;
const std::uint8_t chance[Authentication::chance_size] = {7};

class TestAuthentication : public testing::Test {
 protected:
  TestAuthentication() { use(key_of(3), key_of(5, 100)); }

  void use(const Key& a, const Key& b = Key()) {
    const Key keys[max_keys] = {a, b};
    board.use(keys);
  }
  std::string nonce() const { return str(board.nonce()); }
  std::string sign(std::uint64_t counter, std::uint32_t t = now, const Key& key = key_of(3)) const {
    return with_signature(fields, key, nonce(), counter, t);
  }
  // `text`: fields, without a checksum.
  Verdict verdict(const std::string& text, std::uint32_t now_ms = now) {
    const std::string bytes = with_crc(text);
    Datagram datagram;
    EXPECT_TRUE(read_datagram(Text(bytes), datagram)) << bytes;
    return board.verify(datagram, now_ms);
  }

  Authentication board{chance};
};

TEST(AuthenticationTag, MatchesAnotherImplementation) {  // computed by Python's hashlib
  EXPECT_EQ(with_signature(fields, key_of(3), "0123456789abcdef", 1700000000000000, 79146),
            fields + "A:3,1700000000000000,79146,YDgO3-AnQVQ;");
}

TEST_F(TestAuthentication, AcceptsDatagramsSignedWithAnyOfItsKeys) {
  EXPECT_EQ(verdict(sign(1)), Verdict::authentic);
  EXPECT_EQ(verdict(sign(1, now, key_of(5, 100))), Verdict::authentic)
      << "each key has separate counters";
  EXPECT_EQ(verdict(sign(2, now, key_of(5, 101))), Verdict::wrong_tag);
  EXPECT_EQ(verdict(sign(2, now, key_of(4))), Verdict::unknown_key);
}

TEST_F(TestAuthentication, NeedsASignatureAsTheLastField) {
  EXPECT_EQ(verdict(fields), Verdict::missing);
  EXPECT_EQ(verdict(sign(1) + "X:1;"), Verdict::missing);
  for (const char* form : {"A:", "A:3", "A:3,1,79146", "A:3,1,79146,x,y", "A:3,x,79146,YDgO3-AnQVQ",
                           "A:3,1,-1,YDgO3-AnQVQ", "A:3,1,4294967296,YDgO3-AnQVQ",
                           "A:3,18446744073709551616,1,YDgO3-AnQVQ", "B:3,1,79146,YDgO3-AnQVQ"}) {
    EXPECT_EQ(verdict(fields + form + ";"), Verdict::missing) << form;
  }
  EXPECT_EQ(verdict(fields + "A:03,1,79146,YDgO3-AnQVQ;"), Verdict::unknown_key);
  EXPECT_EQ(verdict(fields + "A:,1,79146,YDgO3-AnQVQ;"), Verdict::unknown_key);
  EXPECT_EQ(verdict(fields + "A:0,1,79146,YDgO3-AnQVQ;"), Verdict::unknown_key);
  EXPECT_EQ(verdict(fields + "A:3,1,79146,;"), Verdict::wrong_tag);
  // A field A that is not the last field is not a signature.
  EXPECT_EQ(verdict(fields + "A:9,9,9,9;A:3,1,79146,YDgO3-AnQVQ;"), Verdict::wrong_tag);
}

TEST_F(TestAuthentication, RejectsEveryChangedByte) {
  const std::string good = sign(1);
  for (std::size_t i = 0; i < good.size(); ++i) {
    for (const char other : {'0', '1', 'Z', 'a', '_'}) {
      std::string changed = good;
      if (changed[i] == other) continue;
      changed[i] = other;
      const std::string bytes = with_crc(changed);
      Datagram datagram;
      if (!read_datagram(Text(bytes), datagram)) continue;
      EXPECT_NE(board.verify(datagram, now), Verdict::authentic) << changed;
    }
  }
  EXPECT_EQ(verdict(good), Verdict::authentic)
      << "a datagram with a wrong tag uses up no counter value";
}

TEST_F(TestAuthentication, AcceptsEachCounterValueOnce) {
  EXPECT_EQ(verdict(sign(0)), Verdict::replayed) << "the first counter is 1";
  EXPECT_EQ(verdict(sign(10)), Verdict::authentic);
  EXPECT_EQ(verdict(sign(10)), Verdict::replayed);
  EXPECT_EQ(verdict(sign(9)), Verdict::authentic) << "a later counter value overtook it";
  EXPECT_EQ(verdict(sign(9)), Verdict::replayed);
  EXPECT_EQ(verdict(sign(10), now + 251), Verdict::replayed);
  EXPECT_EQ(verdict(sign(0xFFFFFFFFFFFFFFFF)), Verdict::authentic);
  EXPECT_EQ(verdict(sign(0xFFFFFFFFFFFFFFFF)), Verdict::replayed);
}

TEST_F(TestAuthentication, RejectsCounterValuesBelowAForgottenOne) {
  constexpr std::uint64_t remembered = Authentication::counters_remembered;
  for (std::uint64_t counter = 100; counter < 100 + remembered; ++counter) {
    EXPECT_EQ(verdict(sign(counter)), Verdict::authentic);
  }
  EXPECT_EQ(verdict(sign(100)), Verdict::replayed);
  EXPECT_EQ(verdict(sign(1000)), Verdict::authentic);
  EXPECT_EQ(verdict(sign(100)), Verdict::replayed)
      << "the board forgot the oldest value for the new one";
  EXPECT_EQ(verdict(sign(99)), Verdict::replayed) << "it may be a forgotten value";
  EXPECT_EQ(verdict(sign(101)), Verdict::replayed);
  EXPECT_EQ(verdict(sign(500)), Verdict::authentic) << "a later counter value overtook it";
  EXPECT_EQ(verdict(sign(101)), Verdict::replayed);
}

// Each key has separate counters. If one key is used much, the board forgets the counter values of
// another key and then refuses that key's counter values.
TEST_F(TestAuthentication, ForgetsTheOldestCounterValueOfAllKeys) {
  const auto sign_other = [this](std::uint64_t counter) {
    return sign(counter, now, key_of(5, 100));
  };
  EXPECT_EQ(verdict(sign_other(7)), Verdict::authentic);
  EXPECT_EQ(verdict(sign_other(9)), Verdict::authentic);
  for (std::uint64_t i = 0; i < Authentication::counters_remembered; ++i) {
    EXPECT_EQ(verdict(sign_other(9)), Verdict::replayed);
    EXPECT_EQ(verdict(sign(1000 + i)), Verdict::authentic);
  }
  EXPECT_EQ(verdict(sign_other(9)), Verdict::replayed);
  EXPECT_EQ(verdict(sign_other(8)), Verdict::replayed);
  EXPECT_EQ(verdict(sign(1)), Verdict::authentic) << "no counter value of this key was forgotten";
  EXPECT_EQ(verdict(sign_other(10)), Verdict::authentic);
}

TEST_F(TestAuthentication, RejectsTimesOlderThan250MsOrInTheFuture) {
  EXPECT_EQ(verdict(sign(1, now - 250)), Verdict::authentic);
  EXPECT_EQ(verdict(sign(2, now - 251)), Verdict::old);
  EXPECT_EQ(verdict(sign(3, now + 1)), Verdict::old);
  EXPECT_EQ(verdict(sign(3, now + 1), now + 1), Verdict::replayed);
  EXPECT_EQ(verdict(sign(4, 0xFFFFFF80), 0x20), Verdict::authentic)
      << "across the wrap of the clock";
}

TEST_F(TestAuthentication, ANewNonceInvalidatesEarlierSignatures) {
  const std::string before = sign(100);
  const std::string old_nonce = nonce();
  board.renew();
  EXPECT_NE(nonce(), old_nonce);
  EXPECT_EQ(verdict(before), Verdict::wrong_tag);
  EXPECT_EQ(verdict(sign(1)), Verdict::authentic) << "a new nonce restarts the counters";
}

TEST_F(TestAuthentication, NoncesHaveSixteenDigitsAndNeverRepeat) {
  std::set<std::string> seen;
  for (int i = 0; i < 10'000; ++i) {
    ASSERT_EQ(nonce().size(), 16U);
    ASSERT_EQ(nonce().find_first_not_of("0123456789abcdef"), std::string::npos);
    ASSERT_TRUE(seen.insert(nonce()).second);
    board.renew();
  }
  const std::uint8_t other[Authentication::chance_size] = {8};
  Authentication rebooted(other);
  const Key keys[max_keys] = {key_of(3)};
  rebooted.use(keys);
  EXPECT_EQ(seen.count(str(rebooted.nonce())), 0U);
}

TEST_F(TestAuthentication, RequiresNoSignatureAndHasNoNonceWithoutAKey) {
  EXPECT_TRUE(board.required());
  use(Key());
  EXPECT_FALSE(board.required());
  EXPECT_EQ(nonce(), "");
}

TEST(AuthenticationWithoutRandomBytes, AcceptsNothing) {
  Authentication board(nullptr);
  const Key keys[max_keys] = {key_of(3)};
  board.use(keys);
  EXPECT_TRUE(board.required());
  EXPECT_EQ(str(board.nonce()), "");
  const std::string bytes = with_crc(with_signature(fields, key_of(3), "", 1, now));
  Datagram datagram;
  ASSERT_TRUE(read_datagram(Text(bytes), datagram));
  EXPECT_EQ(board.verify(datagram, now), Verdict::missing);
}

TEST_F(TestAuthentication, DoesNotAnswerReplayedOrDelayedDatagrams) {
  EXPECT_TRUE(board.rejected(Verdict::missing));
  EXPECT_TRUE(board.rejected(Verdict::wrong_tag));
  EXPECT_TRUE(board.rejected(Verdict::unknown_key));
  EXPECT_FALSE(board.rejected(Verdict::replayed));
  EXPECT_FALSE(board.rejected(Verdict::old));
  EXPECT_TRUE(board.rejected(Verdict::missing));
  EXPECT_EQ(board.rejections(Verdict::missing), 2U);
  EXPECT_EQ(board.rejections(Verdict::unknown_key), 1U);
  EXPECT_EQ(board.rejections(Verdict::wrong_tag), 1U);
  EXPECT_EQ(board.rejections(Verdict::replayed), 1U);
  EXPECT_EQ(board.rejections(Verdict::old), 1U);
}

class TestSigner : public TestAuthentication {
 protected:
  TestSigner() {
    signer.on_nonce(board.nonce());
    signer.on_board_time(now, 1000);
  }
  std::string signed_now(std::uint64_t counter_floor, std::uint32_t now_ms) {
    char buffer[max_datagram];
    DatagramWriter writer(buffer, sizeof buffer);
    writer.field("O").value(358).value(1).value(1);
    writer.stamp(7, 1699276044383);
    signer.sign(writer, counter_floor, now_ms);
    return str(writer.finish());
  }
  Verdict verdict_of(const std::string& bytes, std::uint32_t now_ms) {
    Datagram datagram;
    EXPECT_TRUE(read_datagram(Text(bytes), datagram)) << bytes;
    return board.verify(datagram, now_ms);
  }
  Signer signer{key_of(3)};
};

TEST_F(TestSigner, TheBoardAcceptsItsSignature) {
  const std::string bytes = signed_now(1'700'000'000'000'000, 1000);
  EXPECT_EQ(bytes.find("O:358,1,1;PNum:7;T:1699276044383;A:3,1700000000000000,79146,"), 0U)
      << bytes;
  EXPECT_EQ(verdict_of(bytes, now), Verdict::authentic);
}

TEST_F(TestSigner, TheCounterIncreasesEvenIfTheClockDoesNot) {
  EXPECT_NE(signed_now(500, 1000).find("A:3,500,"), std::string::npos);
  EXPECT_NE(signed_now(500, 1000).find("A:3,501,"), std::string::npos);
  EXPECT_NE(signed_now(400, 1000).find("A:3,502,"), std::string::npos);
  EXPECT_NE(signed_now(600, 1000).find("A:3,600,"), std::string::npos);
}

TEST_F(TestSigner, IsReadyOnceItHasANonce) {
  Signer fresh(key_of(3));
  EXPECT_FALSE(fresh.ready());
  fresh.on_nonce("0123456789abcdef");
  EXPECT_TRUE(fresh.ready());
  fresh.on_nonce(Text());
  EXPECT_FALSE(fresh.ready());
}

TEST_F(TestSigner, NeverSignsATimeAheadOfTheBoardsClock) {
  std::uint64_t counter = 1;
  for (const std::uint32_t passed : {0U, 1U, 2U, 31U, 32U, 100U, 1000U, 5000U}) {
    // A host whose clock is 3 % fast does not send a time in the future.
    const std::uint32_t slow = passed - passed * 3 / 100;
    EXPECT_EQ(verdict_of(signed_now(++counter, 1000 + passed), now + slow), Verdict::authentic)
        << passed;
  }
}

TEST_F(TestSigner, TheLongestSignatureHasTheMaximumSize) {
  Signer longest(key_of(9));
  longest.on_nonce("0123456789abcdef");
  longest.on_board_time(4294967295, 0);
  char buffer[max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  writer.field("Q").value("ID");
  const std::size_t before = writer.size();
  longest.sign(writer, 18446744073709551615U, 0);
  EXPECT_EQ(writer.size() - before, signature_max);
}

}  // namespace
}  // namespace r4
