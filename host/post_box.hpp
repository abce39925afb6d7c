// SPDX-License-Identifier: GPL-3.0-or-later
// Commands on their way from any thread to a loop: a bounded queue that wakes the loop once for all
// that wait. Allocates nothing after its construction, but for commands with texts.
#pragma once

#include <asio/io_context.hpp>
#include <asio/post.hpp>
#include <cstddef>
#include <functional>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "r4link/command.hpp"
#include "r4link/setpoints.hpp"

namespace r4 {

class PostBox {
 public:
  static constexpr std::size_t capacity = 256;

  // `deliver` is called on the loop, once for each command, and `deliver_group` for each group. The loop
  // must not run any more when the box is destroyed.
  PostBox(asio::io_context& io, std::function<void(const Command&)> deliver,
          std::function<void(const Setpoints&)> deliver_group)
      : io_(io), deliver_(std::move(deliver)), deliver_group_(std::move(deliver_group)) {
    waiting_.reserve(capacity);
    taken_.reserve(capacity);
  }

  // Any thread. False if the box is full. A stop is always taken, and comes first.
  bool put(const Command& command) {
    const std::lock_guard lock(mutex_);
    const bool stop = command.kind == CommandKind::stop;
    if (stop) {
      waiting_.clear();  // a stop cancels what was asked for before it
    } else if (waiting_.size() >= capacity) {
      return false;
    }
    Letter& letter = waiting_.emplace_back();
    letter.command = command;
    letter.text.assign(command.text.data(), command.text.size());
    letter.text2.assign(command.text2.data(), command.text2.size());
    wake();
    return true;
  }
  bool put(const Setpoints& group) {
    const std::lock_guard lock(mutex_);
    if (waiting_.size() >= capacity) return false;
    waiting_.emplace_back().group = group;
    wake();
    return true;
  }

 private:
  struct Letter {
    Command command;
    std::string text, text2;
    Setpoints group;  // empty: it is the command
  };

  void wake() {
    if (std::exchange(woken_, true)) return;
    asio::post(io_, Wake{this});
  }

  // Room for the one wake-up that can be on its way.
  template <class T>
  struct Slot {
    using value_type = T;
    explicit Slot(PostBox* b) : box(b) {}
    template <class U>
    Slot(const Slot<U>& other) : box(other.box) {}  // NOLINT(google-explicit-constructor)
    T* allocate(std::size_t count) {
      if (count * sizeof(T) <= sizeof box->wake_memory_) {
        return reinterpret_cast<T*>(box->wake_memory_);
      }
      return std::allocator<T>().allocate(count);
    }
    void deallocate(T* place, std::size_t count) {
      if (reinterpret_cast<std::byte*>(place) == box->wake_memory_) return;
      std::allocator<T>().deallocate(place, count);
    }
    friend bool operator==(const Slot& a, const Slot& b) { return a.box == b.box; }
    PostBox* box;
  };
  struct Wake {
    using allocator_type = Slot<void*>;
    allocator_type get_allocator() const { return allocator_type(box); }
    void operator()() const { box->deliver(); }
    PostBox* box;
  };

  void deliver() {
    {
      const std::lock_guard lock(mutex_);
      woken_ = false;
      taken_.swap(waiting_);
    }
    for (Letter& letter : taken_) {
      if (!letter.group.empty()) {
        deliver_group_(letter.group);
        continue;
      }
      letter.command.text = letter.text;
      letter.command.text2 = letter.text2;
      deliver_(letter.command);
    }
    taken_.clear();
  }

  asio::io_context& io_;
  std::function<void(const Command&)> deliver_;
  std::function<void(const Setpoints&)> deliver_group_;
  std::mutex mutex_;
  std::vector<Letter> waiting_;
  std::vector<Letter> taken_;
  bool woken_ = false;
  alignas(std::max_align_t) std::byte wake_memory_[128];
};

}  // namespace r4
