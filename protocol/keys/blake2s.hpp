// SPDX-License-Identifier: GPL-3.0-or-later
// BLAKE2s (RFC 7693): a hash of 1 to 32 bytes; with a key, a message authentication code.
//     Blake2s hash(32, key, sizeof key);
//     hash.update(Text("abc"));
//     hash.finish(digest);              // 32 bytes
// If one key authenticates many messages, Blake2sKey processes the key once:
//     const Blake2sKey prepared(8, key, sizeof key);
//     Blake2s code(prepared);           // for a message of at least one byte
// Messages have up to 2^32 - 1 bytes, with the key's 64. The time depends only on the sizes.
#pragma once

#include <cstddef>
#include <cstdint>

#include "r4link/text.hpp"

namespace r4 {

constexpr std::size_t blake2s_max_digest = 32;
constexpr std::size_t blake2s_max_key = 32;
constexpr std::size_t blake2s_block = 64;

class Blake2sKey {
 public:
  Blake2sKey() = default;
  // `digest_size`: 1-32; `key_bytes`: 1-32.
  Blake2sKey(std::size_t digest_size, const std::uint8_t* key, std::size_t key_bytes);

 private:
  friend class Blake2s;
  std::uint32_t state_[8] = {};
  std::uint8_t digest_size_ = 0;
};

class Blake2s {
 public:
  // `digest_size`: 1-32; `key_bytes`: 0-32, where 0 means no key.
  explicit Blake2s(std::size_t digest_size, const std::uint8_t* key = nullptr,
                   std::size_t key_bytes = 0);
  // The message must not be empty.
  explicit Blake2s(const Blake2sKey& key);

  void update(const std::uint8_t* bytes, std::size_t size);
  void update(Text text);
  // The hash cannot be used afterwards.
  void finish(std::uint8_t* digest);

 private:
  friend class Blake2sKey;
  void compress(bool last);

  std::uint32_t state_[8];
  std::uint8_t block_[blake2s_block];  // the last block is marked, so it is not compressed early
  std::uint8_t used_ = 0;
  std::uint8_t digest_size_;
  std::uint32_t count_ = 0;
};

}  // namespace r4
