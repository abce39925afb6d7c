// SPDX-License-Identifier: GPL-3.0-or-later
// Passes bytes between two contexts, also interrupts. Lock-free, because each index has one writer.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

namespace r4 {
namespace firmware {

template <std::uint32_t capacity>
class ByteRing {
  static_assert((capacity & (capacity - 1)) == 0, "a power of two");

 public:
  std::uint32_t size() const { return load(put_) - load(taken_); }
  std::uint32_t room() const { return capacity - size(); }
  bool empty() const { return size() == 0; }

  bool put(char byte) {
    if (room() == 0) return false;
    const std::uint32_t at = load(put_);
    bytes_[at % capacity] = byte;
    put_.store(at + 1, std::memory_order_release);
    return true;
  }
  // Puts all bytes or none. The taker sees all bytes at once.
  bool put(const char* data, std::uint32_t size) {
    if (room() < size) return false;
    const std::uint32_t at = load(put_);
    for (std::uint32_t i = 0; i < size; ++i) bytes_[(at + i) % capacity] = data[i];
    put_.store(at + size, std::memory_order_release);
    return true;
  }

  bool take(char& byte) {
    if (empty()) return false;
    const std::uint32_t at = load(taken_);
    byte = bytes_[at % capacity];
    taken_.store(at + 1, std::memory_order_release);
    return true;
  }
  std::uint32_t take(char* data, std::uint32_t size) {
    std::uint32_t count = 0;
    while (count < size && take(data[count])) ++count;
    return count;
  }

  // The byte that take() returns after `offset` other bytes; offset < size().
  char peek(std::uint32_t offset) const { return bytes_[(load(taken_) + offset) % capacity]; }
  // Removes the newest bytes until `size` are left. Call only while the taker does not run.
  void cut(std::uint32_t size) { put_.store(load(taken_) + size, std::memory_order_release); }

 private:
  using Index = std::atomic<std::uint32_t>;
  static std::uint32_t load(const Index& index) { return index.load(std::memory_order_acquire); }

  Index put_{0};  // bytes put so far; wraps
  Index taken_{0};
  char bytes_[capacity];
};

}  // namespace firmware
}  // namespace r4
