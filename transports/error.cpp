// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/error.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <system_error>
#include <utility>

#include "file_descriptor.hpp"

namespace r4 {
namespace {

struct CodePoints {
  std::uint32_t first, last;
};

// Code points that are invisible or change adjacent text: the control and format characters of
// Unicode 15 (Cc, Cf, Zl, Zp), fillers, variation selectors, and code points without a character.
constexpr std::array<CodePoints, 29> unprintable{{
    {0x0000, 0x001F},   {0x007F, 0x009F},   {0x00AD, 0x00AD},   {0x034F, 0x034F},
    {0x0600, 0x0605},   {0x061C, 0x061C},   {0x06DD, 0x06DD},   {0x070F, 0x070F},
    {0x0890, 0x0891},   {0x08E2, 0x08E2},   {0x115F, 0x1160},   {0x17B4, 0x17B5},
    {0x180B, 0x180F},   {0x200B, 0x200F},   {0x2028, 0x202E},   {0x2060, 0x206F},
    {0x3164, 0x3164},   {0xD800, 0xDFFF},   {0xFE00, 0xFE0F},   {0xFEFF, 0xFEFF},
    {0xFFA0, 0xFFA0},   {0xFFF0, 0xFFFB},   {0xFFFE, 0xFFFF},   {0x110BD, 0x110BD},
    {0x110CD, 0x110CD}, {0x13430, 0x1345F}, {0x1BCA0, 0x1BCA3}, {0x1D173, 0x1D17A},
    {0xE0000, 0xE0FFF},
}};

bool is_printable(std::uint32_t code) {
  const auto at = std::lower_bound(
      unprintable.begin(), unprintable.end(), code,
      [](const CodePoints& range, std::uint32_t value) { return range.last < value; });
  return at == unprintable.end() || code < at->first;
}

// The size of the printable UTF-8 character (RFC 3629) at the front of `text`; 0 if there is none.
std::size_t printable_size(std::string_view text) {
  const auto byte = [text](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  if (byte(0) < 0x80) return is_printable(byte(0)) ? 1 : 0;
  const std::size_t size = byte(0) >= 0xF0 ? 4 : byte(0) >= 0xE0 ? 3 : 2;
  if (byte(0) < 0xC2 || byte(0) > 0xF4 || text.size() < size) return 0;
  std::uint32_t code = byte(0) & (0x7FU >> size);
  for (std::size_t i = 1; i < size; ++i) {
    if ((byte(i) & 0xC0U) != 0x80) return 0;
    code = code << 6 | (byte(i) & 0x3FU);
  }
  constexpr std::array<std::uint32_t, 5> least{0, 0, 0x80, 0x800, 0x10000};
  return code >= least[size] && code <= 0x10FFFF && is_printable(code) ? size : 0;
}

}  // namespace

std::string printable(std::string_view text) {
  constexpr std::string_view digits = "0123456789abcdef";
  std::string out;
  out.reserve(text.size());
  while (!text.empty()) {
    const auto plain_end =
        std::find_if(text.begin(), text.end(), [](char c) { return c < ' ' || c > '~'; });
    const auto plain = static_cast<std::size_t>(plain_end - text.begin());
    const std::size_t size = plain != 0 ? plain : printable_size(text);
    if (size != 0) {
      out += text.substr(0, size);
    } else {
      const auto byte = static_cast<unsigned char>(text[0]);
      out += {'\\', 'x', digits[byte >> 4], digits[byte & 15]};
    }
    text.remove_prefix(std::max<std::size_t>(size, 1));
  }
  return out;
}

std::string Problem::text() const {
  return printable(thing + ": " + reason + (fix.empty() ? "" : "; " + fix));
}

const char* to_text(Outcome outcome) {
  constexpr std::array names{"none",   "confirmed", "refused", "timed out", "cancelled",
                             "closed", "blocked",   "full",    "not armed"};
  static_assert(names.size() == static_cast<std::size_t>(Outcome::not_armed) + 1);
  const auto at = static_cast<std::size_t>(outcome);
  return at < names.size() ? names[at] : "unknown";
}

Problem problem_of(const std::string& thing, const std::system_error& error) {
  if (auto problem = out_of_resources(thing, error.code().value())) return *std::move(problem);
  if (error.code().value() == EAGAIN) {
    return {ErrorKind::open, thing, "this user has reached the limit of threads",
            "end some programs, or raise the limit, which ulimit -u shows"};
  }
  return {ErrorKind::open, thing, "the system refused: " + error.code().message(),
          "end some programs, and try again"};
}

}  // namespace r4
