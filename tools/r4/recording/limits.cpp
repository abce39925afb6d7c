// SPDX-License-Identifier: GPL-3.0-or-later
#include "limits.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <string_view>

#include "../shell/number.hpp"
#include "r4link/error.hpp"

namespace r4::tool {
namespace {

struct Unit {
  std::string_view name;
  std::uint64_t factor;
};
constexpr std::array<Unit, 3> sizes{{{"K", 1000}, {"M", 1'000'000}, {"G", 1'000'000'000}}};
constexpr std::array<Unit, 3> times{{{"s", 1}, {"min", 60}, {"h", 3600}}};
constexpr std::uint64_t most = 1'000'000;

template <std::size_t n>
std::optional<std::uint64_t> read(std::string_view text, const std::array<Unit, n>& units) {
  const std::size_t digits = std::min(text.find_first_not_of("0123456789"), text.size());
  const auto number = number_in<std::uint64_t>(text.substr(0, digits));
  if (!number || *number == 0 || *number > most) return std::nullopt;
  for (const Unit& unit : units) {
    if (text.substr(digits) == unit.name) return *number * unit.factor;
  }
  return std::nullopt;
}

}  // namespace

std::uint64_t read_size(const std::string& option, const std::string& text) {
  const std::optional<std::uint64_t> size = read(text, sizes);
  if (size) return *size;
  throw Error(ErrorKind::usage, option + " " + text, "is not a valid size",
              "write 500K, 100M or 2G");
}

void take_rotation(const std::string& text, RecordingOptions& out) {
  if (const auto size = read(text, sizes)) {
    out.rotate_bytes = *size;
  } else if (const auto time = read(text, times)) {
    out.rotate_after = std::chrono::seconds(*time);
  } else {
    throw Error(ErrorKind::usage, "--rotate " + text, "is neither a size nor a time",
                "write 500K, 100M or 2G, or 30s, 10min or 1h");
  }
}

}  // namespace r4::tool
