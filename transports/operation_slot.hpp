// SPDX-License-Identifier: GPL-3.0-or-later
// Memory and cancellation for one asynchronous operation that is started repeatedly: a carrier has
// a slot for each kind of wait, so that waiting uses no heap. After cancel() or the slot's
// destruction, the handler is never called. For one thread, like a carrier.
#pragma once

#include <asio/basic_waitable_timer.hpp>
#include <asio/error_code.hpp>
#include <asio/io_context.hpp>
#include <asio/posix/basic_stream_descriptor.hpp>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <utility>

namespace r4 {

// Asio's objects with the loop's own executor: any_io_executor costs 0.1 us more per operation.
using LoopExecutor = asio::io_context::executor_type;
using LoopDescriptor = asio::posix::basic_stream_descriptor<LoopExecutor>;
using LoopTimer =
    asio::basic_waitable_timer<std::chrono::steady_clock,
                               asio::wait_traits<std::chrono::steady_clock>, LoopExecutor>;

class OperationSlot {
  struct Memory {
    alignas(std::max_align_t) std::byte bytes[256];
    bool taken = false;
    std::uint32_t started = 0;  // counts operations: only the newest operation is called
  };

  template <class T>
  class Allocator {
   public:
    using value_type = T;
    explicit Allocator(Memory& memory) : memory_(&memory) {}
    template <class U>
    // NOLINTNEXTLINE(google-explicit-constructor): as the standard requires
    Allocator(const Allocator<U>& other) : memory_(other.memory_) {}

    T* allocate(std::size_t count) {
      if (!memory_->taken && count * sizeof(T) <= sizeof(memory_->bytes)) {
        memory_->taken = true;
        return reinterpret_cast<T*>(memory_->bytes);
      }
      return static_cast<T*>(
          ::operator new(count * sizeof(T)));  // a cancelled operation uses the memory
    }
    void deallocate(T* at, std::size_t) {
      if (reinterpret_cast<std::byte*>(at) == memory_->bytes) {
        memory_->taken = false;
      } else {
        ::operator delete(at);
      }
    }
    template <class U>
    bool operator==(const Allocator<U>& other) const {
      return memory_ == other.memory_;
    }

   private:
    template <class>
    friend class Allocator;
    Memory* memory_;  // its Operation keeps it alive
  };

  template <class Function>
  class Operation {
   public:
    using allocator_type = Allocator<std::byte>;
    Operation(std::shared_ptr<Memory> memory, Function function)
        : memory_(std::move(memory)), number_(memory_->started), function_(std::move(function)) {}

    allocator_type get_allocator() const noexcept { return allocator_type(*memory_); }

    void operator()() {
      if (memory_->started == number_) function_();
    }
    // A wait that failed (its descriptor was closed) ends without a call.
    void operator()(const asio::error_code& error) {
      if (!error) (*this)();
    }
    void operator()(const asio::error_code& error, std::size_t size) {
      if (memory_->started == number_) function_(error, size);
    }

   private:
    std::shared_ptr<Memory> memory_;
    std::uint32_t number_;
    Function function_;
  };

 public:
  OperationSlot() = default;
  OperationSlot(const OperationSlot&) = delete;
  OperationSlot& operator=(const OperationSlot&) = delete;
  ~OperationSlot() { cancel(); }

  // Calls `function()`, or `function(error, size)` after a transfer. Cancels the earlier operation.
  template <class Function>
  Operation<Function> handler(Function function) {
    ++memory_->started;
    return Operation<Function>(memory_, std::move(function));
  }

  void cancel() { ++memory_->started; }

 private:
  std::shared_ptr<Memory> memory_ = std::make_shared<Memory>();
};

}  // namespace r4
