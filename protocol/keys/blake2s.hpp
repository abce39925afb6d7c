// SPDX-License-Identifier: GPL-3.0-or-later
// BLAKE2s (RFC 7693): a hash of 1 to 32 bytes, and with a key a message authentication code.
//
//     Blake2s hash(32, key, sizeof key);
//     hash.update(Text("abc"));
//     hash.finish(digest);              // 32 bytes
//
// Where one key authenticates many messages, Blake2sKey does the key's part once:
//
//     const Blake2sKey prepared(8, key, sizeof key);
//     Blake2s code(prepared);           // for a message of at least one byte
//
// Messages of up to 2^32 - 1 bytes, the key's block of 64 included. Nothing fails; the time depends
// on the sizes only, never on the bytes.
#pragma once

#include <cstddef>
#include <cstdint>

#include "r4link/text.hpp"

namespace r4 {

constexpr std::size_t blake2s_max_digest = 32;
constexpr std::size_t blake2s_max_key = 32;
constexpr std::size_t blake2s_block = 64;

// A key ready for use: what the hash has become behind the block that holds it.
class Blake2sKey {
 public:
  Blake2sKey() = default;
  // Codes of `digest_size` bytes (1-32) by a key of `key_bytes` bytes (1-32).
  Blake2sKey(std::size_t digest_size, const std::uint8_t* key, std::size_t key_bytes);

 private:
  friend class Blake2s;
  std::uint32_t state_[8] = {};
  std::uint8_t digest_size_ = 0;
};

class Blake2s {
 public:
  // A digest of `digest_size` bytes (1-32), with a key of `key_bytes` bytes (0-32; 0: no key).
  explicit Blake2s(std::size_t digest_size, const std::uint8_t* key = nullptr,
                   std::size_t key_bytes = 0);
  // With a key made ready. The message must not be empty.
  explicit Blake2s(const Blake2sKey& key);

  void update(const std::uint8_t* bytes, std::size_t size);
  void update(Text text);
  // Writes the digest; the hash is of no use then.
  void finish(std::uint8_t* digest);

 private:
  friend class Blake2sKey;
  void compress(bool last);

  std::uint32_t state_[8];
  std::uint8_t block_[blake2s_block];  // compressed when more comes, for the last one is marked
  std::uint8_t used_ = 0;              // of block_
  std::uint8_t digest_size_;
  std::uint32_t count_ = 0;  // bytes compressed
};

}  // namespace r4
