// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/can_bus_model.hpp"

#include <algorithm>
#include <cstring>

namespace r4::test {
namespace {

constexpr std::uint64_t never = ~std::uint64_t{0};
constexpr unsigned passive_errors = 128;
constexpr unsigned bus_off_errors = 256;
constexpr unsigned receive_errors_after_passive = 127;  // a good frame sets the count to 119..127
constexpr unsigned error_step = 8;
constexpr std::uint64_t runs_to_come_back = 128;
constexpr std::uint64_t run_bits = 11;
constexpr std::uint64_t suspend_bits = 8;

// An error frame replaces acknowledge delimiter, end of frame and intermission. All of these bits
// are recessive, and so are the last 11 bits of an error frame.
constexpr std::uint32_t ending_bits =
    can_acknowledge_delimiter_bits + can_end_of_frame_bits + can_intermission_bits;
static_assert(ending_bits == run_bits, "a frame ends in one run of recessive bits");

// If an acknowledgement is missing, the sender begins an error flag at once. If the CRC is wrong,
// the receivers begin their flag one bit later. Delimiter and intermission follow.
constexpr std::uint32_t error_delimiter_bits = 8;
constexpr std::uint32_t error_frame_bits(bool acknowledge_alone) {
  return (acknowledge_alone ? 6 : 7) + error_delimiter_bits + can_intermission_bits;
}

// The bits of arbitration as a number, of which the lowest wins. An 11-bit id wins against a 29-bit
// id that begins with the same bits. A data frame wins against a remote request.
std::uint64_t rank(const CanFrame& frame) {
  const std::uint64_t request = frame.remote ? 1 : 0;
  if (!frame.extended) return std::uint64_t{frame.id} << 21 | request << 20;
  return std::uint64_t{frame.id >> 18} << 21 | 3U << 19 | (frame.id & 0x3FFFFU) << 1 | request;
}

bool same(const CanFrame& a, const CanFrame& b) {
  return a.size == b.size && a.fd == b.fd && std::memcmp(a.data, b.data, a.size) == 0;
}

}  // namespace

int CanBusModel::add_node(CanNodeOptions options) {
  nodes_.emplace_back();
  nodes_.back().options = std::move(options);
  return static_cast<int>(nodes_.size()) - 1;
}

bool CanBusModel::send(int node, const CanFrame& frame) {
  Node& sender = to_node(node);
  if (sender.queue.size() >= sender.options.room) return false;
  sender.queue.push_back({frame, now_ns_});
  return true;
}

void CanBusModel::set_errors(int node, unsigned transmit_errors, unsigned receive_errors) {
  to_node(node).transmit_errors = transmit_errors;
  to_node(node).receive_errors = receive_errors;
  update_state(to_node(node));
}

void CanBusModel::clear(int node) {
  std::vector<Waiting>& queue = to_node(node).queue;
  if (on_bus_ && to_node(node).sending) {
    queue = {queue[to_node(node).chosen]};
    to_node(node).chosen = 0;
  } else {
    queue.clear();
  }
}

std::uint64_t CanBusModel::next_ns() const {
  const std::uint64_t action_ns = actions_.empty() ? never : actions_.begin()->first;
  return std::min(next().time_ns, action_ns);
}

void CanBusModel::run_until(std::uint64_t time_ns) {
  for (;;) {
    const Next bus = next();
    const std::uint64_t action_ns = actions_.empty() ? never : actions_.begin()->first;
    const std::uint64_t first_ns = std::min(bus.time_ns, action_ns);
    if (first_ns > time_ns || first_ns == never) break;
    now_ns_ = first_ns;
    if (action_ns <= bus.time_ns) {
      const auto action = std::move(actions_.begin()->second);
      actions_.erase(actions_.begin());
      action();
    } else if (bus.step == Step::begin) {
      begin_frame();
    } else if (bus.step == Step::end) {
      end_frame();
    } else {
      come_back(nodes_[bus.node]);
    }
  }
  now_ns_ = time_ns;
}

CanBusModel::Next CanBusModel::next() const {
  if (on_bus_) return {Step::end, frame_ends_ns_, 0};
  Next first{Step::none, never, 0};
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    const Node& node = nodes_[i];
    if (!node.present) continue;
    if (node.state == CanNodeState::bus_off) {
      if (!node.options.comes_back) continue;
      const std::uint64_t left = (runs_to_come_back - node.recessive_runs) * run_bits;
      const std::uint64_t time = std::max(recessive_since_ns_ + bits_ns(left), now_ns_);
      if (time < first.time_ns) first = {Step::come_back, time, i};
    } else if (!node.queue.empty()) {
      const std::uint64_t time = std::max({free_at_ns_, node.suspended_until_ns, now_ns_});
      if (time < first.time_ns) first = {Step::begin, time, i};
    }
  }
  return first;
}

// Arbitration. If nodes send exactly the same frame, all of these nodes win. Different frames with
// the same id destroy each other.
void CanBusModel::begin_frame() {
  const std::uint64_t runs = (now_ns_ - recessive_since_ns_) / bits_ns(run_bits);
  std::uint64_t best = never;
  for (Node& node : nodes_) {
    node.sending = false;
    if (!node.present) continue;
    if (node.state == CanNodeState::bus_off) {
      if (node.options.comes_back) node.recessive_runs += runs;
      continue;
    }
    if (node.queue.empty() || node.suspended_until_ns > now_ns_) continue;
    node.chosen = 0;
    if (node.options.queue == CanQueue::mailboxes) {
      const auto lower = [](const Waiting& a, const Waiting& b) {
        return rank(a.frame) < rank(b.frame);
      };
      const auto lowest = std::min_element(node.queue.begin(), node.queue.end(), lower);
      node.chosen = static_cast<std::size_t>(lowest - node.queue.begin());
    }
    node.sending = true;
    best = std::min(best, rank(node.queue[node.chosen].frame));
  }
  const CanFrame* frame = nullptr;
  acknowledged_ = false;
  damaged_ = random_.chance(options_.corrupted);
  if (corrupt_next_ != 0) {
    --corrupt_next_;
    damaged_ = true;
  }
  for (Node& node : nodes_) {
    node.sending = node.sending && rank(node.queue[node.chosen].frame) == best;
    if (!node.sending) {
      acknowledged_ |= node.on_bus() && !node.options.silent;
      continue;
    }
    if (frame != nullptr && !same(*frame, node.queue[node.chosen].frame)) damaged_ = true;
    damaged_ |= node.spoiled;
    frame = &node.queue[node.chosen].frame;
  }
  CanBits bits = can_bits(*frame, options_.rate.data != 0);
  if (damaged_ || !acknowledged_) bits.nominal += error_frame_bits(!damaged_) - ending_bits;
  begun_ns_ = now_ns_;
  free_at_ns_ = now_ns_ + time_ns(bits, options_.rate);
  frame_ends_ns_ = free_at_ns_ - bits_ns(can_intermission_bits);
  recessive_since_ns_ = free_at_ns_ - bits_ns(run_bits);
  on_bus_ = true;
}

void CanBusModel::end_frame() {
  on_bus_ = false;
  if (damaged_ || !acknowledged_) {
    fail();
  } else {
    succeed();
  }
}

void CanBusModel::succeed() {
  CanFrame frame{};
  std::vector<std::size_t> senders;
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    Node& node = nodes_[i];
    if (node.on_bus()) count_success(node, node.sending);
    if (!node.sending) continue;
    const auto sent = node.queue.begin() + static_cast<std::ptrdiff_t>(node.chosen);
    frame = sent->frame;
    CanIdTraffic& traffic = traffic_[frame.id];
    const std::uint64_t latency_ns = now_ns_ - sent->since_ns;
    if (senders.empty()) {
      ++traffic.frames;
      traffic.busy_ns += free_at_ns_ - begun_ns_;
      busy_ns_ += free_at_ns_ - begun_ns_;
    }
    traffic.max_latency_ns = std::max(traffic.max_latency_ns, latency_ns);
    node.queue.erase(sent);
    senders.push_back(i);
  }
  std::vector<std::size_t> receivers;
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    const Node& node = nodes_[i];
    if (node.sending || !node.on_bus()) continue;
    if (!random_.chance(options_.missed)) receivers.push_back(i);
  }
  for (const std::size_t i : senders) {
    if (nodes_[i].options.sent) nodes_[i].options.sent(frame);
  }
  for (const std::size_t i : receivers) {
    if (nodes_[i].options.received) nodes_[i].options.received(frame);
  }
}

void CanBusModel::fail() {
  bool counted = false;
  for (Node& node : nodes_) {
    if (node.sending && !counted) {
      CanIdTraffic& traffic = traffic_[node.queue[node.chosen].frame.id];
      ++traffic.failed;
      traffic.busy_ns += free_at_ns_ - begun_ns_;
      busy_ns_ += free_at_ns_ - begun_ns_;
      counted = true;
    }
    if (!node.on_bus()) continue;
    count_error(node, node.sending);
    if (node.options.failed && (node.sending || damaged_)) {
      node.options.failed(damaged_ ? CanBusError::damaged : CanBusError::not_acknowledged);
    }
  }
}

void CanBusModel::count_success(Node& node, bool sender) {
  if (sender) {
    if (node.transmit_errors != 0) --node.transmit_errors;
  } else if (node.receive_errors >= passive_errors) {
    node.receive_errors = receive_errors_after_passive;
  } else if (node.receive_errors != 0) {
    --node.receive_errors;
  }
  update_state(node);
  if (sender && node.state == CanNodeState::passive) {
    node.suspended_until_ns = free_at_ns_ + bits_ns(suspend_bits);
  }
}

// A missing acknowledgement does not increase the count of a passive sender. So a sender that is
// alone on the bus stays passive.
void CanBusModel::count_error(Node& node, bool sender) {
  if (sender) {
    const bool lonely = !damaged_ && node.state == CanNodeState::passive;
    if (!lonely) node.transmit_errors += error_step;
  } else if (!node.options.silent && damaged_ && node.receive_errors < passive_errors) {
    ++node.receive_errors;
  }
  update_state(node);
  if (sender && node.state == CanNodeState::passive) {
    node.suspended_until_ns = free_at_ns_ + bits_ns(suspend_bits);
  }
}

void CanBusModel::update_state(Node& node) {
  const bool passive =
      node.transmit_errors >= passive_errors || node.receive_errors >= passive_errors;
  const CanNodeState state = node.transmit_errors >= bus_off_errors ? CanNodeState::bus_off
                             : passive                              ? CanNodeState::passive
                                                                    : CanNodeState::active;
  if (state == node.state) return;
  node.state = state;
  node.recessive_runs = 0;
  if (node.options.changed) node.options.changed(state);
}

void CanBusModel::come_back(Node& node) {
  node.transmit_errors = 0;
  node.receive_errors = 0;
  node.suspended_until_ns = 0;
  update_state(node);
}

}  // namespace r4::test
