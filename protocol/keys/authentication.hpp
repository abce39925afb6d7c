// SPDX-License-Identifier: GPL-3.0-or-later
// Proof that a datagram is of a host that has the board's key, made just now and not seen before
// (docs/protocol.md "Authentication"). Both ends; only hosts sign.
//
// The board tells a nonce in its heartbeats, 64 random bits as `AN:<16 hex digits>;`. The host
// signs with the last field of its datagrams:
//
//     A:<key id>,<counter>,<board T>,<tag>;
//
// The tag is 64 bits of BLAKE2s, keyed, over "R4A1", the digits of AN and every byte of the
// datagram before the tag; in base64url without padding (RFC 4648, 5), 11 characters.
//
// What it does not do: hide anything, or prove what the board says.
#pragma once

#include <cstddef>
#include <cstdint>

#include "blake2s.hpp"
#include "r4link/datagram.hpp"
#include "r4link/key.hpp"
#include "r4link/messages/datagram_writer.hpp"

namespace r4 {

constexpr std::size_t nonce_size = 16;  // its digits
constexpr std::size_t tag_size = 11;    // its characters

// The longest `A` field: ";A:9,18446744073709551615,4294967295,<tag>".
constexpr std::size_t signature_max = 3 + 1 + 1 + 20 + 1 + 10 + 1 + tag_size;

// The tag of a datagram whose bytes before the tag are `before` and a comma. `key` is of
// signing_key().
void write_tag(const Blake2sKey& key, Text nonce, Text before, char (&tag)[tag_size]);
// The key of the direction host to board, which is made of the shared one.
Blake2sKey signing_key(const Key& key);

// What a board finds out about a datagram.
enum class Verdict : std::uint8_t {
  authentic,
  missing,      // its last field is no A of the form above
  unknown_key,  // no key of that id
  wrong_tag,    // changed, of another key, or for another nonce
  replayed,     // the counter was used, or one that was forgotten may have been it
  old,          // its board T is more than 250 ms ago, or yet to come
};
constexpr int verdict_count = 6;
// "authentic", "missing", "unknown key", "wrong tag", "replayed", "old".
const char* to_text(Verdict verdict);

// The board's end.
class Authentication {
 public:
  static constexpr std::size_t chance_size = 32;
  static constexpr std::uint32_t age_limit_ms = 250;
  // So many counters are remembered, the newest of all keys together. Each path of a session uses its own: at r
  // datagrams a second over p paths they are those of the last 112 / (p r) seconds, and a path may lag by that. What is
  // below a forgotten one counts as used.
  static constexpr int counters_remembered = 112;

  // `chance`: random bytes, others at each boot, from which the nonces are made. nullptr: the board
  // has none; then it tells no nonce, and nothing is ever authentic.
  explicit Authentication(const std::uint8_t* chance);

  // The board's keys; those with id 0 are none. Takes a new nonce.
  void use(const Key (&keys)[max_keys]);
  // Is there a key, and so a signature needed?
  bool required() const { return required_; }

  // The nonce that heartbeats tell; empty while no signature is needed.
  Text nonce() const { return Text(nonce_, has_nonce_ ? nonce_size : 0); }
  // Another nonce: what was signed before is of no use then. Counters begin anew.
  void renew();
  // Checks in the place of a board that tells this nonce, as a bridge does. Empty: the board tells
  // none, and nothing is authentic. Counters begin anew with another nonce.
  void follow(Text nonce);

  // Is there chance to make random numbers of?
  bool has_chance() const { return has_chance_; }
  // Another random number each time, which cannot be told from those before; never 0. Only where
  // there is chance.
  std::uint32_t random();

  // Is it signed? If so, its counter is used up.
  Verdict verify(const Datagram& datagram, std::uint32_t now_ms);
  // Counts a datagram that needs a signature and has no good one. True if it is answered: what a network has repeated
  // or held back is not.
  bool rejected(Verdict verdict);
  // How many were rejected for that.
  std::uint32_t rejections(Verdict verdict) const {
    return rejections_[static_cast<std::size_t>(verdict)];
  }

 private:
  struct Entry {
    Blake2sKey key;
    std::uint64_t highest = 0;    // counter that was used
    std::uint64_t forgotten = 0;  // the highest of those that are not remembered any more
    std::uint8_t id = 0;
  };
  Entry* find(int id);
  void forget_counters();
  bool is_used(const Entry& entry, std::uint64_t counter) const;
  void spend(Entry& entry, std::uint64_t counter);
  void draw(Text purpose, std::uint8_t (&digest)[nonce_size / 2]);

  Entry entries_[max_keys];
  // In the order in which they were used, from next_ on.
  std::uint64_t counters_[counters_remembered] = {};
  std::uint8_t used_with_[counters_remembered] = {};  // the key's id; 0: none yet
  int next_ = 0;
  bool required_ = false;
  Blake2sKey chance_;
  bool has_chance_;
  std::uint32_t draws_ = 0;  // so far
  char nonce_[nonce_size] = {};
  bool has_nonce_ = false;
  std::uint32_t rejections_[verdict_count] = {};
};

// The host's end: signs for one board.
class Signer {
 public:
  explicit Signer(const Key& key) : key_(signing_key(key)), id_(key.id) {}

  // The newest heartbeat of the board has this nonce (heartbeat_nonce()); empty: none, it has no
  // key. True if it is not the one before.
  bool on_nonce(Text nonce);
  // The newest datagram of the board has this T. `now_ms`: the host's clock, which wraps.
  void on_board_time(std::uint32_t t_ms, std::uint32_t now_ms);
  // Has a nonce been heard? Nothing can be signed before.
  bool ready() const { return has_nonce_; }

  // Writes the field A behind all others: finish() of the writer is to follow. `counter_floor` is
  // the least that the counter may be: microseconds since 1970, so that a host which begins again
  // goes on above what it has used. Only while ready().
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
