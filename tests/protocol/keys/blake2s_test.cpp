// SPDX-License-Identifier: GPL-3.0-or-later
#include "protocol/keys/blake2s.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

namespace r4 {
namespace {

using Bytes = std::vector<std::uint8_t>;

std::string hex(const Bytes& bytes) {
  std::string text;
  for (const std::uint8_t byte : bytes) {
    text += "0123456789abcdef"[byte >> 4];
    text += "0123456789abcdef"[byte & 15U];
  }
  return text;
}

// The digest, computed in pieces of `step` bytes.
Bytes digest_of(const Bytes& message, std::size_t digest_size, const Bytes& key,
                std::size_t step = ~std::size_t{0}) {
  Blake2s hash(digest_size, key.data(), key.size());
  for (std::size_t at = 0; at < message.size();) {
    const std::size_t size = std::min(step, message.size() - at);
    hash.update(message.data() + at, size);
    at += size;
  }
  Bytes digest(digest_size);
  hash.finish(digest.data());
  return digest;
}

// A Fibonacci generator as in RFC 7693, appendix E.
Bytes sequence(std::size_t size, std::uint32_t seed) {
  Bytes bytes;
  std::uint32_t a = 0xDEAD4BADU * seed;
  std::uint32_t b = 1;
  for (std::size_t i = 0; i < size; ++i) {
    const std::uint32_t t = a + b;
    a = b;
    b = t;
    bytes.push_back(static_cast<std::uint8_t>(t >> 24));
  }
  return bytes;
}

TEST(Blake2s, GivesTheDigestOfTheStandardsExample) {
  EXPECT_EQ(hex(digest_of({'a', 'b', 'c'}, 32, {})),
            "508c5e8c327c14e2e1a72ba34eeb452f37458b209ed63a294d999b4c86675982");
}

TEST(Blake2s, PassesTheStandardsSelfTest) {
  Blake2s all(32);
  const std::size_t digest_sizes[] = {16, 20, 28, 32};
  const std::size_t message_sizes[] = {0, 3, 64, 65, 255, 1024};
  for (const std::size_t digest_size : digest_sizes) {
    for (const std::size_t size : message_sizes) {
      const Bytes message = sequence(size, static_cast<std::uint32_t>(size));
      const Bytes plain = digest_of(message, digest_size, {});
      all.update(plain.data(), plain.size());
      const Bytes key = sequence(digest_size, static_cast<std::uint32_t>(digest_size));
      const Bytes keyed = digest_of(message, digest_size, key);
      all.update(keyed.data(), keyed.size());
    }
  }
  Bytes digest(32);
  all.finish(digest.data());
  EXPECT_EQ(hex(digest), "6a411f08ce25adcdfb02aba641451cec53c598b24f4fc787fbdc88797f4c1dfe");
}

TEST(Blake2s, GivesTheSameDigestForAMessageInPieces) {
  for (std::size_t size = 0; size <= 200; ++size) {
    const Bytes message = sequence(size, 7);
    const Bytes key = sequence(1 + size % 32, 9);
    const Bytes whole = digest_of(message, 8, key);
    for (const std::size_t step : {1U, 3U, 63U, 64U, 65U}) {
      EXPECT_EQ(digest_of(message, 8, key, step), whole) << size << " by " << step;
    }
  }
}

TEST(Blake2s, GivesTheSameDigestWithAPreparedKey) {
  const Bytes key = sequence(32, 3);
  const Blake2sKey prepared(8, key.data(), key.size());
  for (std::size_t size = 1; size <= 200; ++size) {
    const Bytes message = sequence(size, 5);
    Blake2s hash(prepared);
    hash.update(message.data(), message.size());
    Bytes digest(8);
    hash.finish(digest.data());
    EXPECT_EQ(digest, digest_of(message, 8, key)) << size;
  }
}

}  // namespace
}  // namespace r4
