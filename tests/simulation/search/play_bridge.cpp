// SPDX-License-Identifier: GPL-3.0-or-later
// A story with the shipped bridge. Hosts and strangers are on one side, and the board is on the
// other side.
#include <utility>

#include "play.hpp"
#include "tests/simulation/world_host.hpp"

namespace r4::simulation {

void Play::begin_bridge() {
  bridge_ = std::make_unique<test::ScriptedBridge>();
  set_clock_of_bridge();
  bridge_->pair->open();
  carry_from_bridge(nullptr);
}

void Play::set_clock_of_bridge() {
  bridge_->now = std::chrono::steady_clock::time_point(std::chrono::hours(1) +
                                                       std::chrono::microseconds(world_.now_us_));
}

void Play::tick_bridge() {
  set_clock_of_bridge();
  bridge_->hosts->drained();
  bridge_->board->drained();
  bridge_->pair->tick();
  carry_from_bridge(nullptr);
  after(std::chrono::microseconds(WaitingTime::tick_interval).count(), [this] { tick_bridge(); });
}

bool Play::bridge_takes(const Packet& arrived) {
  if (arrived.peer == bridge_peer) return false;
  if (keep_trace_) world_.show("bridge receives " + arrived.bytes);
  set_clock_of_bridge();
  bridge_->hosts->say_bytes(arrived.bytes, arrived.peer);
  carry_from_bridge(&arrived);
  return true;
}

// Delivers the datagrams that the bridge has sent to both sides. `packet`: the datagram that the
// bridge received before.
void Play::carry_from_bridge(const Packet* packet) {
  for (const auto& sent : std::exchange(bridge_->board->sent, {})) {
    Packet passed;
    if (packet != nullptr && packet->bytes == sent.text) passed = *packet;
    passed.to_board = true;
    passed.peer = bridge_peer;
    if (passed.bytes.empty()) {
      passed.host = -1;
      passed.sent_us = world_.now_us_;
      passed.bytes = sent.text;
      world_.describe(passed);
    }
    deliver_in(bridge_us, passed);
  }
  for (const auto& sent : std::exchange(bridge_->hosts->sent, {})) {
    const std::uint32_t peer = sent.to == everyone ? bridge_->hosts->held : sent.to;
    if (peer == Stranger::address) stranger_.hears(sent.text);
    for (int i = 0; i < static_cast<int>(world_.hosts_.size()); ++i) {
      const Host& each = host(i);
      if (!each.places.empty() && each.places.front().peer == peer) {
        world_.transfer(false, i, 0, sent.text);
      }
    }
  }
}

}  // namespace r4::simulation
