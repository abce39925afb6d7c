// SPDX-License-Identifier: GPL-3.0-or-later
#include "authentication.hpp"

#include <cstring>

#include "../datagram/numbers.hpp"

namespace r4 {
namespace {

constexpr Text version("R4A1");
constexpr Text host_to_board("R4 host to board");
constexpr Text field_name("A");
constexpr std::size_t tag_bytes = 8;

// Base64url without padding: six bits a character, the last two bits are 0.
void write_base64url(const std::uint8_t (&bytes)[tag_bytes], char (&out)[tag_size]) {
  constexpr Text digits("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_");
  std::uint64_t bits = 0;
  for (const std::uint8_t byte : bytes) bits = bits << 8 | byte;
  out[tag_size - 1] = digits[bits << 2 & 0x3FU];
  bits >>= 4;
  for (std::size_t i = tag_size - 1; i-- != 0; bits >>= 6) out[i] = digits[bits & 0x3FU];
}

// Constant time, so that the time does not help a forger.
bool same(Text tag, const char (&expected)[tag_size]) {
  if (tag.size() != tag_size) return false;
  unsigned difference = 0;
  for (std::size_t i = 0; i < tag_size; ++i) {
    difference |= static_cast<unsigned char>(tag[i]) ^ static_cast<unsigned char>(expected[i]);
  }
  return difference == 0;
}

int id_of(Text digit) {
  return digit.size() == 1 && digit[0] >= '1' && digit[0] <= '0' + max_key_id ? digit[0] - '0' : 0;
}

Field last_field(const Datagram& datagram) {
  Field last;
  for (const Field& field : datagram) last = field;
  return last;
}

}  // namespace

const char* to_text(Verdict verdict) {
  switch (verdict) {
    case Verdict::authentic:
      break;
    case Verdict::missing:
      return "missing";
    case Verdict::unknown_key:
      return "unknown key";
    case Verdict::wrong_tag:
      return "wrong tag";
    case Verdict::replayed:
      return "replayed";
    case Verdict::old:
      return "old";
  }
  return "authentic";
}

void write_tag(const Blake2sKey& key, Text nonce, Text before, char (&tag)[tag_size]) {
  Blake2s hash(key);
  hash.update(version);
  hash.update(nonce);
  hash.update(before);
  hash.update(",");
  std::uint8_t digest[tag_bytes];
  hash.finish(digest);
  write_base64url(digest, tag);
}

Blake2sKey signing_key(const Key& key) {
  Blake2s derivation(key_size, key.bytes, key_size);
  derivation.update(host_to_board);
  std::uint8_t derived[key_size];
  derivation.finish(derived);
  return Blake2sKey(tag_bytes, derived, sizeof derived);
}

Authentication::Authentication(const std::uint8_t* chance) : has_chance_(chance != nullptr) {
  if (has_chance_) chance_ = Blake2sKey(nonce_size / 2, chance, chance_size);
}

void Authentication::use(const Key (&keys)[max_keys]) {
  required_ = false;
  for (int i = 0; i < max_keys; ++i) {
    entries_[i].id = keys[i].id;
    if (keys[i].id == 0) continue;
    entries_[i].key = signing_key(keys[i]);
    required_ = true;
  }
  renew();
}

void Authentication::renew() {
  has_nonce_ = required_ && has_chance_;
  forget_counters();
  if (!has_nonce_) return;
  std::uint8_t digest[nonce_size / 2];
  draw(Text(), digest);
  write_hex(nonce_, digest, sizeof digest);
}

void Authentication::follow(Text nonce) {
  if (nonce == this->nonce()) return;
  has_nonce_ = nonce.size() == nonce_size;
  forget_counters();
  if (has_nonce_) std::memcpy(nonce_, nonce.data(), nonce_size);
}

void Authentication::forget_counters() {
  for (Entry& entry : entries_) entry.highest = entry.forgotten = 0;
  for (std::uint8_t& id : used_with_) id = 0;
}

std::uint32_t Authentication::random() {
  std::uint8_t digest[nonce_size / 2];
  draw("W", digest);
  std::uint32_t number = 0;
  for (int i = 0; i < 4; ++i) number = number << 8 | digest[i];
  return number != 0 ? number : 1;
}

void Authentication::draw(Text purpose, std::uint8_t (&digest)[nonce_size / 2]) {
  char number[max_number_text];
  const char* const end = write_number(number, ++draws_);
  Blake2s hash(chance_);
  hash.update(purpose);
  hash.update(Text(number, static_cast<std::size_t>(end - number)));
  hash.finish(digest);
}

Authentication::Entry* Authentication::find(int id) {
  for (Entry& entry : entries_) {
    if (id != 0 && entry.id == id) return &entry;
  }
  return nullptr;
}

Verdict Authentication::verify(const Datagram& datagram, std::uint32_t now_ms) {
  const Field field = last_field(datagram);
  Text values[4];
  std::uint64_t counter = 0;
  std::uint32_t board_t = 0;
  if (!has_nonce_ || field.name() != field_name || field.split(values, 4) != 4 ||
      !parse_number(values[1], counter) || !parse_number(values[2], board_t)) {
    return Verdict::missing;
  }
  Entry* const entry = find(id_of(values[0]));
  if (entry == nullptr) return Verdict::unknown_key;
  const char* const begin = datagram.bytes().begin();
  const Text before(begin, static_cast<std::size_t>(values[2].end() - begin));
  char expected[tag_size];
  write_tag(entry->key, nonce(), before, expected);
  if (!same(values[3], expected)) return Verdict::wrong_tag;
  const bool fresh = now_ms - board_t <= age_limit_ms;
  if (counter <= entry->forgotten || is_used(*entry, counter)) return Verdict::replayed;
  spend(*entry, counter);
  return fresh ? Verdict::authentic : Verdict::old;
}

bool Authentication::is_used(const Entry& entry, std::uint64_t counter) const {
  if (counter > entry.highest) return false;
  for (int i = 0; i < counters_remembered; ++i) {
    if (counters_[i] == counter && used_with_[i] == entry.id) return true;
  }
  return false;
}

void Authentication::spend(Entry& entry, std::uint64_t counter) {
  Entry* const forgets = find(used_with_[next_]);
  if (forgets != nullptr && counters_[next_] > forgets->forgotten) {
    forgets->forgotten = counters_[next_];
  }
  counters_[next_] = counter;
  used_with_[next_] = entry.id;
  next_ = (next_ + 1) % counters_remembered;
  if (counter > entry.highest) entry.highest = counter;
}

bool Authentication::rejected(Verdict verdict) {
  ++rejections_[static_cast<std::size_t>(verdict)];
  return verdict != Verdict::replayed && verdict != Verdict::old;
}

bool Signer::on_nonce(Text nonce) {
  if (has_nonce_ && nonce == Text(nonce_, nonce_size)) return false;
  const bool had = has_nonce_;
  has_nonce_ = nonce.size() == nonce_size;
  if (has_nonce_) std::memcpy(nonce_, nonce.data(), nonce_size);
  return had || has_nonce_;
}

void Signer::on_board_time(std::uint32_t t_ms, std::uint32_t now_ms) {
  t_ms_ = t_ms;
  heard_ms_ = now_ms;
}

// Estimates the board's clock from its newest T. The estimate leaves out a 32nd of the time since
// then, because the host's clock may be up to 3 % faster. The board refuses a T ahead of its clock.
std::uint32_t Signer::board_time(std::uint32_t now_ms) const {
  const std::uint32_t passed = now_ms - heard_ms_;
  return passed == 0 ? t_ms_ : t_ms_ + (passed - passed / 32 - 1);
}

void Signer::sign(DatagramWriter& writer, std::uint64_t counter_floor, std::uint32_t now_ms) {
  counter_ = counter_ + 1 > counter_floor ? counter_ + 1 : counter_floor;
  writer.field(field_name);
  writer.value(std::uint32_t{id_}).value(counter_).value(board_time(now_ms));
  char tag[tag_size];
  write_tag(key_, Text(nonce_, nonce_size), writer.written(), tag);
  writer.value(Text(tag, tag_size));
}

}  // namespace r4
