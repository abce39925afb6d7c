// SPDX-License-Identifier: GPL-3.0-or-later
// The input of a fuzzer as a list of small numbers, and require() for the conditions that must
// hold.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>

namespace r4 {

inline void require(bool holds) {
  if (!holds) std::abort();
}

// The input, byte by byte, with zeros after its end.
class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : at_(data), end_(data + size) {}
  bool empty() const { return at_ == end_; }
  std::uint8_t byte() { return empty() ? std::uint8_t{0} : *at_++; }
  std::uint32_t word() {
    const std::uint32_t high = byte();
    return high << 8 | byte();
  }

 private:
  const std::uint8_t* at_;
  const std::uint8_t* end_;
};

}  // namespace r4
