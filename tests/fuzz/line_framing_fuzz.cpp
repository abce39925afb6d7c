// SPDX-License-Identifier: GPL-3.0-or-later
// Any stream, cut anywhere, gives the same lines as the uncut stream, in bounded memory. The first
// four bytes of the input choose the cuts.
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "transports/framing/line_framing.hpp"

namespace r4 {
namespace {

void require(bool holds) {
  if (!holds) std::abort();
}

struct Split {
  std::vector<std::string> lines;
  std::vector<std::string> oversize;  // the beginnings of lines that are too long
  bool operator==(const Split&) const = default;
};

// The expected result, computed in the simplest way.
Split expected(const std::string& stream) {
  Split split;
  std::string line;
  const auto end_line = [&](bool finished) {
    if (line.size() > max_datagram) {
      split.oversize.push_back(line.substr(0, max_datagram));
    } else if (finished && !line.empty()) {
      split.lines.push_back(line);
    }
    line.clear();
  };
  for (const char c : stream) {
    if (c == '\r' || c == '\n') {
      end_line(true);
    } else {
      line += c;
    }
  }
  end_line(false);
  return split;
}

Split framed(const std::string& stream, std::uint32_t cuts) {
  Split split;
  LineFraming framing;
  for (std::size_t at = 0; at < stream.size();) {
    cuts = cuts * 1664525U + 1013904223U;
    // Most pieces are small. One piece in 16 may be longer than a line.
    const std::size_t limit = (cuts >> 28) == 0 ? 3000 : (cuts >> 28) * 8;
    const std::string part = stream.substr(at, (cuts >> 8) % limit);
    at += part.size();
    framing.push(
        part.data(), part.size(),
        [&](Text line) { split.lines.emplace_back(line.data(), line.size()); },
        [&](Text beginning) { split.oversize.emplace_back(beginning.data(), beginning.size()); });
    require(framing.pending() <= max_datagram);
  }
  require(framing.oversize() == split.oversize.size());
  return split;
}

}  // namespace
}  // namespace r4

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::uint32_t cuts = 0;
  if (size < sizeof cuts) return 0;
  std::memcpy(&cuts, data, sizeof cuts);
  const std::string stream(reinterpret_cast<const char*>(data) + sizeof cuts, size - sizeof cuts);
  r4::require(r4::framed(stream, cuts) == r4::expected(stream));
  return 0;
}
