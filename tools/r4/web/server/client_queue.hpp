// SPDX-License-Identifier: GPL-3.0-or-later
// What waits for one client of r4 web. One that is slow loses its oldest states, and hears how many messages of them;
// what is no state is never lost: a client for which too much of that waits cannot be served. Time is passed in.
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
  std::shared_ptr<const std::string> body;  // the same for all clients
  std::string head;                         // in front of it, of this client; none: it is text
  Kind kind = Kind::other;
  std::size_t size() const { return head.size() + (body ? body->size() : 0); }
};

class ClientQueue {
 public:
  using Time = std::chrono::steady_clock::time_point;
  // A state that has waited for longer is not worth sending.
  static constexpr std::chrono::milliseconds oldest_state{250};
  static constexpr std::size_t most_state_bytes = std::size_t{512} << 10;
  static constexpr std::size_t most_other_bytes = std::size_t{256} << 10;

  // False: there is no room for it.
  bool push(Outgoing message, Time now);
  std::optional<Outgoing> pop();
  bool empty() const { return states_.empty() && others_.empty(); }
  std::size_t bytes() const { return state_bytes_ + other_bytes_; }
  // States that were lost since the last call.
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
