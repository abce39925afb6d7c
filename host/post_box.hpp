// SPDX-License-Identifier: GPL-3.0-or-later
// A bounded queue of commands from any thread to a loop. Allocates only for commands with texts.
#pragma once

#include <asio/bind_allocator.hpp>
#include <asio/io_context.hpp>
#include <asio/post.hpp>
#include <cstddef>
#include <functional>
#include <memory_resource>
#include <mutex>
#include <utility>
#include <variant>
#include <vector>

#include "r4link/command.hpp"
#include "r4link/commands/command_text.hpp"
#include "r4link/setpoints.hpp"

namespace r4 {

// The command, or the first command of the group. Its texts are views of `what`.
inline Command first_of(const CommandOrGroup& what) {
  const auto* const group = std::get_if<Setpoints>(&what);
  return group != nullptr ? (*group)[0] : Command(std::get<OwnCommand>(what));
}

class PostBox {
 public:
  static constexpr std::size_t capacity = 256;

  // `deliver` is called on the loop for each command or group. The loop must end before the box.
  PostBox(asio::io_context& io, std::function<void(const CommandOrGroup&)> deliver)
      : io_(io), deliver_(std::move(deliver)) {
    waiting_.reserve(capacity);
    taken_.reserve(capacity);
  }

  // From any thread. False if the box is full. A stop is never refused, and is delivered first.
  bool put(const CommandOrGroup& letter) {
    const std::lock_guard lock(mutex_);
    if (first_of(letter).kind == CommandKind::stop) waiting_.clear();
    if (waiting_.size() >= capacity) return false;
    waiting_.push_back(letter);
    if (std::exchange(woken_, true)) return true;
    const std::pmr::polymorphic_allocator<std::byte> allocator(&wake_memory_);
    asio::post(io_, asio::bind_allocator(allocator, [this] { deliver(); }));
    return true;
  }

 private:
  void deliver() {
    {
      const std::lock_guard lock(mutex_);
      woken_ = false;
      wake_memory_.release();  // Asio freed this memory before the call
      taken_.swap(waiting_);
    }
    for (const CommandOrGroup& letter : taken_) deliver_(letter);
    taken_.clear();
  }

  asio::io_context& io_;
  const std::function<void(const CommandOrGroup&)> deliver_;
  std::mutex mutex_;
  std::vector<CommandOrGroup> waiting_;
  std::vector<CommandOrGroup> taken_;
  bool woken_ = false;
  // Memory of the only wake-up under way.
  alignas(std::max_align_t) std::byte wake_buffer_[128];
  std::pmr::monotonic_buffer_resource wake_memory_{wake_buffer_, sizeof wake_buffer_};
};

}  // namespace r4
