// SPDX-License-Identifier: GPL-3.0-or-later
// Proves that a datagram is from a host with the board's key, is recent and was not received before
// (docs/reference/protocol.md "Authentication"). Only hosts sign. The board sends a nonce in its
// heartbeats: 64 random bits, `AN:<16 hex digits>;`. The host's last field is the signature:
//     A:<key id>,<counter>,<board T>,<tag>;
// The tag is 64 bits of keyed BLAKE2s over "R4A1", the digits of AN and every byte of the datagram
// before the tag. A tag is 11 characters of base64url without padding (RFC 4648, 5). No encryption.
#pragma once

#include <cstddef>
#include <cstdint>

#include "blake2s.hpp"
#include "r4link/datagram.hpp"
#include "r4link/key.hpp"
#include "r4link/messages/datagram_writer.hpp"

namespace r4 {

constexpr std::size_t nonce_size = 16;  // hexadecimal digits
constexpr std::size_t tag_size = 11;    // characters

// The longest `A` field: ";A:9,18446744073709551615,4294967295,<tag>".
constexpr std::size_t signature_max = 3 + 1 + 1 + 20 + 1 + 10 + 1 + tag_size;

// `before`: the datagram's bytes before the tag and its comma. `key` is from signing_key().
void write_tag(const Blake2sKey& key, Text nonce, Text before, char (&tag)[tag_size]);
// The key for the direction host to board, derived from the shared key.
Blake2sKey signing_key(const Key& key);

enum class Verdict : std::uint8_t {
  authentic,
  missing,      // the last field is not a valid A
  unknown_key,  // no key with that id
  wrong_tag,    // changed, other key, or other nonce
  replayed,     // the counter was used, or is not above a forgotten counter
  old,          // the board T is over 250 ms old, or in the future
};
constexpr int verdict_count = 6;
const char* to_text(Verdict verdict);

class Authentication {
 public:
  static constexpr std::size_t chance_size = 32;
  static constexpr std::uint32_t age_limit_ms = 250;
  // Shared by all keys. A counter below a forgotten counter counts as used. Each path of a session
  // has its own counters: with r datagrams a second over p paths, a path may lag by 112 / (p r) s.
  static constexpr int counters_remembered = 112;

  // `chance`: random bytes, different at each boot; nullptr: no nonce, no authentic datagram.
  explicit Authentication(const std::uint8_t* chance);

  // Sets the board's keys; an id of 0 means no key. Takes a new nonce.
  void use(const Key (&keys)[max_keys]);
  bool required() const { return required_; }

  // The nonce for heartbeats; empty while no signature is needed.
  Text nonce() const { return Text(nonce_, has_nonce_ ? nonce_size : 0); }
  // Takes another nonce: earlier signatures become invalid, and counters restart.
  void renew();
  // For a bridge: its board's nonce. A new one restarts counters. Empty: no datagram is authentic.
  void follow(Text nonce);

  bool has_chance() const { return has_chance_; }
  // An unpredictable number, never 0. Call only if has_chance().
  std::uint32_t random();

  // Checks the signature. If its tag is valid, its counter is used up.
  Verdict verify(const Datagram& datagram, std::uint32_t now_ms);
  // Counts a datagram whose required signature is missing or not valid. True if the board must
  // answer. The board does not answer a datagram that the network repeated or delayed.
  bool rejected(Verdict verdict);
  std::uint32_t rejections(Verdict verdict) const {
    return rejections_[static_cast<std::size_t>(verdict)];
  }

 private:
  struct Entry {
    Blake2sKey key;
    std::uint64_t highest = 0;
    std::uint64_t forgotten = 0;  // highest forgotten counter
    std::uint8_t id = 0;
  };
  Entry* find(int id);
  void forget_counters();
  bool is_used(const Entry& entry, std::uint64_t counter) const;
  void spend(Entry& entry, std::uint64_t counter);
  void draw(Text purpose, std::uint8_t (&digest)[nonce_size / 2]);

  Entry entries_[max_keys];
  // In the order of use, from next_ on.
  std::uint64_t counters_[counters_remembered] = {};
  std::uint8_t used_with_[counters_remembered] = {};  // key id; 0: none yet
  int next_ = 0;
  bool required_ = false;
  Blake2sKey chance_;
  bool has_chance_;
  std::uint32_t draws_ = 0;
  char nonce_[nonce_size] = {};
  bool has_nonce_ = false;
  std::uint32_t rejections_[verdict_count] = {};
};

class Signer {
 public:
  explicit Signer(const Key& key) : key_(signing_key(key)), id_(key.id) {}

  // The newest heartbeat's nonce; empty: the board has no key. True if the nonce is new.
  bool on_nonce(Text nonce);
  // The T of the board's newest datagram. `now_ms`: the host's clock, which wraps.
  void on_board_time(std::uint32_t t_ms, std::uint32_t now_ms);
  bool ready() const { return has_nonce_; }

  // Writes the field A after all other fields; call the writer's finish() next. Only while ready().
  // `counter_floor`, in us since 1970: the least counter, so that a restarted host continues above.
  void sign(DatagramWriter& writer, std::uint64_t counter_floor, std::uint32_t now_ms);

 private:
  std::uint32_t board_time(std::uint32_t now_ms) const;

  Blake2sKey key_;
  std::uint8_t id_;
  char nonce_[nonce_size] = {};
  bool has_nonce_ = false;
  std::uint32_t t_ms_ = 0;
  std::uint32_t heard_ms_ = 0;
  std::uint64_t counter_ = 0;
};

}  // namespace r4
