// SPDX-License-Identifier: GPL-3.0-or-later
#include "blake2s.hpp"

#include <cstring>

namespace r4 {
namespace {

constexpr std::uint32_t initial[8] = {0x6A09E667, 0xBB67AE85, 0x3C6EF372, 0xA54FF53A,
                                      0x510E527F, 0x9B05688C, 0x1F83D9AB, 0x5BE0CD19};

// The message word for each position, in each round (RFC 7693, 2.7).
constexpr int rounds = 10;
constexpr std::uint8_t schedule[rounds][16] = {
    {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15},
    {14, 10, 4, 8, 9, 15, 13, 6, 1, 12, 0, 2, 11, 7, 5, 3},
    {11, 8, 12, 0, 5, 2, 15, 13, 10, 14, 3, 6, 7, 1, 9, 4},
    {7, 9, 3, 1, 13, 12, 11, 14, 2, 6, 5, 10, 4, 0, 15, 8},
    {9, 0, 5, 7, 2, 4, 10, 15, 14, 1, 11, 12, 6, 8, 3, 13},
    {2, 12, 6, 10, 0, 11, 8, 3, 4, 13, 7, 5, 15, 14, 1, 9},
    {12, 5, 1, 15, 14, 13, 4, 10, 0, 7, 6, 3, 9, 2, 8, 11},
    {13, 11, 7, 14, 12, 1, 3, 9, 5, 0, 15, 4, 8, 6, 2, 10},
    {6, 15, 14, 9, 11, 3, 0, 8, 12, 2, 13, 7, 1, 4, 10, 5},
    {10, 2, 8, 4, 7, 6, 1, 5, 15, 11, 9, 14, 3, 12, 13, 0},
};

constexpr std::uint32_t rotated_right(std::uint32_t x, int bits) {
  return x >> bits | x << (32 - bits);
}

std::uint32_t word_at(const std::uint8_t* bytes) {
  return std::uint32_t{bytes[0]} | std::uint32_t{bytes[1]} << 8 | std::uint32_t{bytes[2]} << 16 |
         std::uint32_t{bytes[3]} << 24;
}

inline void mix(std::uint32_t& a, std::uint32_t& b, std::uint32_t& c, std::uint32_t& d,
                std::uint32_t x, std::uint32_t y) {
  a += b + x;
  d = rotated_right(d ^ a, 16);
  c += d;
  b = rotated_right(b ^ c, 12);
  a += b + y;
  d = rotated_right(d ^ a, 8);
  c += d;
  b = rotated_right(b ^ c, 7);
}

}  // namespace

Blake2s::Blake2s(std::size_t digest_size, const std::uint8_t* key, std::size_t key_bytes)
    : digest_size_(static_cast<std::uint8_t>(digest_size)) {
  for (int i = 0; i < 8; ++i) state_[i] = initial[i];
  // The parameter block: sizes of digest and key, fanout 1, depth 1.
  state_[0] ^= 0x01010000U ^ static_cast<std::uint32_t>(key_bytes) << 8 ^
               static_cast<std::uint32_t>(digest_size);
  if (key_bytes == 0) return;
  std::memset(block_, 0, sizeof block_);
  std::memcpy(block_, key, key_bytes);
  used_ = sizeof block_;
}

Blake2s::Blake2s(const Blake2sKey& key) : digest_size_(key.digest_size_), count_(blake2s_block) {
  std::memcpy(state_, key.state_, sizeof state_);
}

Blake2sKey::Blake2sKey(std::size_t digest_size, const std::uint8_t* key, std::size_t key_bytes)
    : digest_size_(static_cast<std::uint8_t>(digest_size)) {
  Blake2s hash(digest_size, key, key_bytes);
  hash.compress(false);
  std::memcpy(state_, hash.state_, sizeof state_);
}

void Blake2s::compress(bool last) {
  count_ += used_;
  std::uint32_t m[16];
  for (int i = 0; i < 16; ++i) m[i] = word_at(block_ + 4 * i);
  std::uint32_t v[16];
  for (int i = 0; i < 8; ++i) {
    v[i] = state_[i];
    v[i + 8] = initial[i];
  }
  v[12] ^= count_;  // the upper half of the 64-bit count stays 0
  if (last) v[14] = ~v[14];
  for (const std::uint8_t(&s)[16] : schedule) {
    mix(v[0], v[4], v[8], v[12], m[s[0]], m[s[1]]);
    mix(v[1], v[5], v[9], v[13], m[s[2]], m[s[3]]);
    mix(v[2], v[6], v[10], v[14], m[s[4]], m[s[5]]);
    mix(v[3], v[7], v[11], v[15], m[s[6]], m[s[7]]);
    mix(v[0], v[5], v[10], v[15], m[s[8]], m[s[9]]);
    mix(v[1], v[6], v[11], v[12], m[s[10]], m[s[11]]);
    mix(v[2], v[7], v[8], v[13], m[s[12]], m[s[13]]);
    mix(v[3], v[4], v[9], v[14], m[s[14]], m[s[15]]);
  }
  for (int i = 0; i < 8; ++i) state_[i] ^= v[i] ^ v[i + 8];
  used_ = 0;
}

void Blake2s::update(const std::uint8_t* bytes, std::size_t size) {
  while (size != 0) {
    if (used_ == sizeof block_) compress(false);
    const std::size_t room = sizeof block_ - used_;
    const std::size_t taken = size < room ? size : room;
    std::memcpy(block_ + used_, bytes, taken);
    used_ = static_cast<std::uint8_t>(used_ + taken);
    bytes += taken;
    size -= taken;
  }
}

void Blake2s::update(Text text) {
  update(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
}

void Blake2s::finish(std::uint8_t* digest) {
  std::memset(block_ + used_, 0, sizeof block_ - used_);
  compress(true);
  for (std::size_t i = 0; i < digest_size_; ++i) {
    digest[i] = static_cast<std::uint8_t>(state_[i / 4] >> 8 * (i % 4));
  }
}

}  // namespace r4
