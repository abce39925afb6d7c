// SPDX-License-Identifier: GPL-3.0-or-later
// A bounded queue of commands from any thread to a loop. Allocates only for commands with texts. If
// the loop stands still, a command that waits for longer than `oldest` is late, unless it switches
// outputs off.
#pragma once

#include <asio/bind_allocator.hpp>
#include <asio/io_context.hpp>
#include <asio/post.hpp>
#include <chrono>
#include <cstddef>
#include <functional>
#include <memory_resource>
#include <mutex>
#include <utility>
#include <variant>
#include <vector>

#include "commands/switches_off.hpp"
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
  using Clock = std::chrono::steady_clock;
  static constexpr std::size_t capacity = 256;
  static constexpr std::chrono::milliseconds oldest{100};  // as in SendQueue

  // On the loop, `deliver` is called for each command or group; `late`: it waited too long. The
  // loop must end before the box.
  using Deliver = std::function<void(const CommandOrGroup& what, bool late)>;
  PostBox(asio::io_context& io, Deliver deliver, Clock::time_point (*now)() = &Clock::now)
      : io_(io), deliver_(std::move(deliver)), now_(now) {
    waiting_.reserve(capacity);
    taken_.reserve(capacity);
  }

  // From any thread. False if the box is full. A stop is never refused, and is delivered first.
  bool put(const CommandOrGroup& what) {
    const std::lock_guard lock(mutex_);
    if (first_of(what).kind == CommandKind::stop) waiting_.clear();
    if (waiting_.size() >= capacity) return false;
    waiting_.push_back({what, now_()});
    if (std::exchange(woken_, true)) return true;
    const std::pmr::polymorphic_allocator<std::byte> allocator(&wake_memory_);
    asio::post(io_, asio::bind_allocator(allocator, [this] { deliver(); }));
    return true;
  }

 private:
  struct Letter {
    CommandOrGroup what;
    Clock::time_point at;
  };

  void deliver() {
    {
      const std::lock_guard lock(mutex_);
      woken_ = false;
      wake_memory_.release();  // Asio freed this memory before the call
      taken_.swap(waiting_);
    }
    const Clock::time_point now = now_();
    for (const Letter& letter : taken_) {
      const bool off = std::visit([](const auto& each) { return switches_off(each); }, letter.what);
      deliver_(letter.what, now - letter.at > oldest && !off);
    }
    taken_.clear();
  }

  asio::io_context& io_;
  const Deliver deliver_;
  Clock::time_point (*const now_)();
  std::mutex mutex_;
  std::vector<Letter> waiting_;
  std::vector<Letter> taken_;
  bool woken_ = false;
  // Memory of the only wake-up under way.
  alignas(std::max_align_t) std::byte wake_buffer_[128];
  std::pmr::monotonic_buffer_resource wake_memory_{wake_buffer_, sizeof wake_buffer_};
};

}  // namespace r4
