// SPDX-License-Identifier: GPL-3.0-or-later
#include "grammar.hpp"

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace r4 {

const ByteClasses byte_classes;

#if defined(__SSE2__)

namespace {

constexpr unsigned lane = 16;

// Marks the separators among the 16 bytes at `at` except the first `surplus`, in the bits from
// `shift` on.
inline void add_separators(const char* at, unsigned surplus, unsigned shift, Separators& out) {
  const __m128i bytes = _mm_loadu_si128(reinterpret_cast<const __m128i*>(at));
  const auto equal = [&](char c) { return _mm_cmpeq_epi8(bytes, _mm_set1_epi8(c)); };
  const auto bits = [&](__m128i mask) {
    return static_cast<std::uint64_t>(static_cast<unsigned>(_mm_movemask_epi8(mask)) >> surplus)
           << shift;
  };
  const __m128i semicolon = equal(';');
  // The comparison is signed, so bytes from 0x80 are included.
  const __m128i below_space = _mm_cmplt_epi8(bytes, _mm_set1_epi8(' '));
  const __m128i no_field = _mm_or_si128(below_space, _mm_or_si128(equal('^'), equal('\x7F')));
  const __m128i no_name =
      _mm_or_si128(_mm_or_si128(no_field, semicolon), _mm_or_si128(equal(' '), equal(',')));
  out.colons |= bits(equal(':'));
  out.semicolons |= bits(semicolon);
  out.no_name |= bits(no_name);
  out.no_field |= bits(no_field);
}

}  // namespace

Separators separators(Text text, std::size_t at) {
  Separators out{0, 0, 0, 0};
  char copy[lane] = {};
  const Text block = text.substr(at, separators_block);
  unsigned shift = 0;
  for (; shift + lane <= block.size(); shift += lane) {
    add_separators(block.data() + shift, 0, shift, out);
  }
  if (shift == block.size()) return out;
  // The last bytes are read with the bytes before them, so that no byte after the text is read.
  const char* from = copy;
  if (text.size() < lane) {
    std::memcpy(copy + lane - block.size(), block.data(), block.size());
  } else {
    from = block.end() - lane;
  }
  add_separators(from, lane - (static_cast<unsigned>(block.size()) - shift), shift, out);
  return out;
}

#else

namespace {

struct Half {
  std::uint32_t colons = 0;
  std::uint32_t semicolons = 0;
  std::uint32_t no_name = 0;
  std::uint32_t no_field = 0;
};

inline std::uint64_t joined(std::uint32_t low, std::uint32_t high) {
  return std::uint64_t{high} << 32 | low;
}

Half half_separators(const char* at, std::size_t size) {
  Half out;
  std::uint32_t bit = 1;
  for (const char* const end = at + size; at != end; ++at, bit <<= 1) {
    // Test first for the most frequent bytes.
    if (is_in(ByteClasses::in_name, *at)) continue;
    if (*at == ':') {
      out.colons |= bit;
      continue;
    }
    out.no_name |= bit;
    if (*at == ';') {
      out.semicolons |= bit;
    } else if (!is_in(ByteClasses::in_values, *at)) {
      out.no_field |= bit;
    }
  }
  return out;
}

}  // namespace

Separators separators(Text text, std::size_t at) {
  const Text block = text.substr(at, separators_block);
  constexpr std::size_t half = separators_block / 2;
  const std::size_t size = block.size() < half ? block.size() : half;
  const Half low = half_separators(block.data(), size);
  const Half high = half_separators(block.data() + size, block.size() - size);
  return {joined(low.colons, high.colons), joined(low.semicolons, high.semicolons),
          joined(low.no_name, high.no_name), joined(low.no_field, high.no_field)};
}

#endif

namespace {

// For each bit of `starts`, within a run of set bits of `run`: the bit after that run. The addition
// carries a start through its run. `carry` continues a run in bit 0 of the next word.
std::uint64_t run_ends(std::uint64_t run, std::uint64_t starts, std::uint64_t& carry) {
  const std::uint64_t sum = run + (starts | carry);
  carry = sum < run ? 1 : 0;
  return sum & ~run;
}

}  // namespace

bool mark_fields(Text fields, std::uint64_t* ends, std::uint64_t* short_names) {
  if (fields.empty() || *(fields.end() - 1) != ';') return false;
  std::uint64_t starts = 0;
  std::uint64_t first = 1;  // 1 if a field begins with the word's first byte
  std::uint64_t name_carry = 0;
  std::uint64_t value_carry = 0;
  for (std::size_t at = 0, word = 0; at < fields.size(); at += separators_block, ++word) {
    const Separators found = separators(fields, at);
    const std::uint64_t name = ~(found.colons | found.no_name);
    const std::uint64_t value = ~(found.semicolons | found.no_field);
    const std::uint64_t before = starts;
    starts = found.semicolons << 1 | first;
    first = found.semicolons >> 63;
    const std::uint64_t name_ends = run_ends(name, starts & name, name_carry);
    const std::uint64_t field_ends = run_ends(value, name_ends, value_carry);
    if ((starts & ~name) != 0 || (name_ends & ~found.colons) != 0 ||
        field_ends != found.semicolons) {
      return false;
    }
    ends[word] = name_ends | field_ends;
    short_names[word] = name_ends & (starts << 1 | before >> 63 | starts << 3 | before >> 61 |
                                     starts << 4 | before >> 60);
  }
  return true;
}

}  // namespace r4
