// SPDX-License-Identifier: GPL-3.0-or-later
// Messages that wait for one client. A slow client loses its oldest states, and gets their number.
// If too many other messages wait, the client is dropped. The caller passes in the time.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>

namespace r4::tool::web {

struct Outgoing {
  enum class Kind : std::uint8_t { state, other };
  std::shared_ptr<const std::string> body;
  std::string head;  // prefix for this client; empty: a text message
  Kind kind = Kind::other;
  std::size_t size() const { return head.size() + (body ? body->size() : 0); }
};

class ClientQueue {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::milliseconds oldest_state{250};
  static constexpr std::size_t most_state_bytes = std::size_t{512} << 10;
  static constexpr std::size_t most_other_bytes = std::size_t{256} << 10;

  bool push(Outgoing message, Time now);
  std::optional<Outgoing> pop();
  bool empty() const { return states_.empty() && others_.empty(); }
  std::size_t bytes() const { return state_bytes_ + other_bytes_; }
  std::uint64_t take_lost();

 private:
  struct Waiting {
    Outgoing message;
    Time since{};
    std::uint64_t number = 0;
  };
  void drop_oldest();

  std::deque<Waiting> states_;
  std::deque<Waiting> others_;
  std::size_t state_bytes_ = 0;
  std::size_t other_bytes_ = 0;
  std::uint64_t next_ = 0;
  std::uint64_t lost_ = 0;
};

}  // namespace r4::tool::web
