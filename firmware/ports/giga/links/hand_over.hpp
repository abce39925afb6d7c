// SPDX-License-Identifier: GPL-3.0-or-later
// Hands the newest value to another thread; neither waits. A seqlock: take() fails during a write.
#pragma once

#include <atomic>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace r4 {
namespace giga {

template <class T>
class HandOver {
  static_assert(std::is_trivially_copyable<T>::value, "copied byte by byte");

 public:
  void put(const T& value) {
    const std::uint32_t before = version_.load(std::memory_order_relaxed);
    version_.store(before + 1, std::memory_order_relaxed);  // odd: being written
    unsigned char flat[sizeof(T)];
    std::memcpy(flat, &value, sizeof flat);
    for (std::size_t i = 0; i < sizeof flat; ++i) {
      bytes_[i].store(flat[i], std::memory_order_release);  // a reader also sees the odd version
    }
    version_.store(before + 2, std::memory_order_release);
  }

  // Takes a value newer than version `known` (0: none); updates `known`. False: no newer value.
  bool take(std::uint32_t& known, T& value) const {
    const std::uint32_t before = version_.load(std::memory_order_acquire);
    if (before == known || before % 2 != 0) return false;
    unsigned char flat[sizeof(T)];
    for (std::size_t i = 0; i < sizeof flat; ++i) {
      flat[i] = bytes_[i].load(std::memory_order_acquire);
    }
    if (version_.load(std::memory_order_relaxed) != before) return false;
    std::memcpy(&value, flat, sizeof flat);
    known = before;
    return true;
  }

 private:
  std::atomic<std::uint32_t> version_{0};
  std::atomic<unsigned char> bytes_[sizeof(T)];
};

}  // namespace giga
}  // namespace r4
