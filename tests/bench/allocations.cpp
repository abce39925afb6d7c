// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/bench/allocations.hpp"

#include <atomic>
#include <cstdlib>
#include <new>

namespace {

std::atomic<std::uint64_t> count{0};
thread_local std::uint64_t count_of_this_thread = 0;

// ThreadSanitizer has its own operators, so no allocation is counted there. Release and asan count.
#ifndef R4_THREAD_SANITIZER
void add_one() {
  count.fetch_add(1, std::memory_order_relaxed);
  ++count_of_this_thread;
}

// Returns nullptr if there is no memory.
void* allocate(std::size_t size) {
  add_one();
  return std::malloc(size == 0 ? 1 : size);
}

void* allocate(std::size_t size, std::align_val_t alignment) {
  add_one();
  const auto align = static_cast<std::size_t>(alignment);
  return std::aligned_alloc(align, (size + align - 1) / align * align);
}

void* or_throw(void* memory) {
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}
#endif

}  // namespace

#ifndef R4_THREAD_SANITIZER

// The array forms of the standard library call these operators. A sanitizer's nothrow forms do not
// call these operators, so this file also replaces the nothrow forms.
void* operator new(std::size_t size) { return or_throw(allocate(size)); }
void* operator new(std::size_t size, const std::nothrow_t&) noexcept { return allocate(size); }
void* operator new(std::size_t size, std::align_val_t alignment) {
  return or_throw(allocate(size, alignment));
}
void* operator new(std::size_t size, std::align_val_t alignment, const std::nothrow_t&) noexcept {
  return allocate(size, alignment);
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
#endif

namespace r4::bench {

std::uint64_t allocations() { return count.load(std::memory_order_relaxed); }
std::uint64_t allocations_of_this_thread() { return count_of_this_thread; }

}  // namespace r4::bench
