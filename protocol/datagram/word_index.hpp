// SPDX-License-Identifier: GPL-3.0-or-later
// Finds words by their hash; the compiler builds the index. Of equal words, the first is found.
#pragma once

#include <cstddef>
#include <cstdint>

#include "r4link/text.hpp"

namespace r4 {

constexpr unsigned no_index = 0xFF;

// `word_of` returns the word of an entry. The table must be constexpr and outlive the index.
template <class Entry, unsigned count, Text (*word_of)(const Entry&)>
class WordIndex {
 public:
  constexpr explicit WordIndex(const Entry (&table)[count]) : table_(table) {
    for (std::uint8_t& slot : entry_) slot = no_index;
    for (unsigned i = 0; i < count; ++i) {
      const Text word = word_of(table[i]);
      if (word.size() > longest_) longest_ = word.size();
      unsigned slot = slot_of(word);
      while (entry_[slot] != no_index) slot = (slot + 1) % slot_count;
      entry_[slot] = static_cast<std::uint8_t>(i);
    }
  }

  // The index of the entry with `word`, or no_index. Constant time.
  unsigned find(Text word) const {
    if (word.size() > longest_) return no_index;
    for (unsigned slot = slot_of(word);; slot = (slot + 1) % slot_count) {
      const unsigned found = entry_[slot];
      if (found == no_index || word_of(table_[found]) == word) return found;
    }
  }

 private:
  static constexpr unsigned slot_count = count < 128 ? 256 : 512;
  static_assert(count < slot_count / 2, "less than half full");

  static constexpr std::uint32_t byte(char c) { return static_cast<unsigned char>(c); }
  static constexpr std::uint32_t four_bytes(const char* at) {  // compiled to one load
    return byte(at[0]) | byte(at[1]) << 8 | byte(at[2]) << 16 | byte(at[3]) << 24;
  }

  // Most words differ in their first or last four bytes, or in their size.
  static constexpr unsigned slot_of(Text word) {
    const std::size_t size = word.size();
    if (size == 0) return 0;
    const bool is_short = size < 4;
    const char* const begin = word.data();
    const std::uint32_t first = is_short ? byte(begin[0]) : four_bytes(begin);
    const std::uint32_t last = is_short ? byte(begin[size - 1]) : four_bytes(begin + size - 4);
    const std::uint32_t mixed = (first + 3 * last) ^ static_cast<std::uint32_t>(size);
    return (mixed * 0xC2B2AE35U >> 20) % slot_count;
  }

  const Entry* table_;
  std::size_t longest_ = 0;
  std::uint8_t entry_[slot_count] = {};
};

}  // namespace r4
