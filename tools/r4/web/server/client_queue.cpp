// SPDX-License-Identifier: GPL-3.0-or-later
#include "client_queue.hpp"

#include <utility>

namespace r4::tool::web {

bool ClientQueue::push(Outgoing message, Time now) {
  const std::size_t size = message.size();
  if (message.kind == Outgoing::Kind::other) {
    if (other_bytes_ + size > most_other_bytes) return false;
    other_bytes_ += size;
    others_.push_back({std::move(message), now, next_++});
    return true;
  }
  while (!states_.empty() &&
         (now - states_.front().since > oldest_state || state_bytes_ + size > most_state_bytes)) {
    drop_oldest();
  }
  if (size > most_state_bytes) {
    ++lost_;
    return true;
  }
  state_bytes_ += size;
  states_.push_back({std::move(message), now, next_++});
  return true;
}

void ClientQueue::drop_oldest() {
  state_bytes_ -= states_.front().message.size();
  states_.pop_front();
  ++lost_;
}

std::optional<Outgoing> ClientQueue::pop() {
  if (empty()) return std::nullopt;
  const bool state =
      others_.empty() || (!states_.empty() && states_.front().number < others_.front().number);
  std::deque<Waiting>& from = state ? states_ : others_;
  (state ? state_bytes_ : other_bytes_) -= from.front().message.size();
  Outgoing message = std::move(from.front().message);
  from.pop_front();
  return message;
}

std::uint64_t ClientQueue::take_lost() { return std::exchange(lost_, 0); }

}  // namespace r4::tool::web
