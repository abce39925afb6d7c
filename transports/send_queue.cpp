// SPDX-License-Identifier: GPL-3.0-or-later
#include "send_queue.hpp"

#include <cstring>

namespace r4 {
namespace {

constexpr std::size_t stop_entries = 8;

}  // namespace

SendQueue::SendQueue(std::size_t normal, std::size_t states, std::uint64_t& dropped)
    : stop_(stop_entries), normal_(normal), state_(states), dropped_(dropped) {}

SendResult SendQueue::push(std::string_view bytes, Priority priority, Peer to, Time now) {
  const bool normal = priority == Priority::normal || priority == Priority::lease;
  Lane& lane = priority == Priority::stop ? stop_ : normal ? normal_ : state_;
  if (normal) {
    while (lane.count != 0 && lane.entries[lane.first].expires <= now) {
      lane.pop();
      ++dropped_;
    }
  }
  if (lane.count == lane.capacity) {
    ++dropped_;
    if (normal) return SendResult::full;
    lane.pop();
  }
  if (lane.entries.empty()) lane.entries.resize(lane.capacity);
  Entry& entry = lane.entries[(lane.first + lane.count) % lane.capacity];
  ++lane.count;
  entry.expires = priority == Priority::stop ? Time::max() : now + lifetime;
  entry.to = to;
  entry.priority = priority;
  entry.size = static_cast<std::uint16_t>(bytes.size());
  std::memcpy(entry.bytes, bytes.data(), bytes.size());
  return SendResult::sent;
}

const SendQueue::Entry* SendQueue::front(Time now) {
  for (Lane* lane : {&stop_, &normal_, &state_}) {
    while (lane->count != 0) {
      const Entry& entry = lane->entries[lane->first];
      if (entry.expires > now) {
        front_ = lane;
        return &entry;
      }
      lane->pop();
      ++dropped_;
    }
  }
  return nullptr;
}

void SendQueue::pop() { front_->pop(); }

bool SendQueue::empty() const { return stop_.count + normal_.count + state_.count == 0; }

void SendQueue::clear() {
  for (Lane* lane : {&stop_, &normal_, &state_}) {
    dropped_ += lane->count;
    lane->count = 0;
  }
}

void SendQueue::Lane::pop() {
  first = (first + 1) % capacity;
  --count;
}

}  // namespace r4
