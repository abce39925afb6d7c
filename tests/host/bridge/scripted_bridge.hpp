// SPDX-License-Identifier: GPL-3.0-or-later
// A bridge between two scripted transports, in virtual time.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "host/bridge/bridged_pair.hpp"
#include "tests/support/carriers.hpp"
#include "tests/support/datagrams.hpp"
#include "transports/board_end.hpp"

namespace r4::test {

class ScriptedCarrier final : public IdleCarrier, public BoardEnd {
 public:
  struct Sent {
    std::string text;
    Priority priority;
    Peer to;
  };

  ScriptedCarrier() { also_held.reserve(100); }

  void open(Handler& handler) override {
    if (absence) throw Error(*absence);
    IdleCarrier::open(handler);
  }
  SendResult send(std::string_view bytes, Priority priority, Peer to) override {
    if (result == SendResult::sent && keeps) sent.push_back({std::string(bytes), priority, to});
    return result;
  }
  void hold(Peer peer) override {
    held = peer;
    also_held.clear();
  }
  void also_hold(Peer peer) override {
    if (peer != held) also_held.push_back(peer);
  }
  bool reaches(Peer peer) const override { return peer == everyone || peer == held; }
  bool is_shared() const override { return shared; }
  const CarrierCounters& counters() const override { return counted; }

  void say(const std::string& fields, Peer from = everyone) { say_bytes(with_crc(fields), from); }
  void say_bytes(const std::string& bytes, Peer from = everyone) {
    handler_->on_datagram(bytes, from);
  }
  void drained() { handler_->on_drained(); }
  void report(CarrierEvent::Kind kind) { handler_->on_carrier_event({kind, {}}); }
  // The datagrams sent since the last call, without checksums. "@peer" follows a datagram that was
  // sent to one peer.
  std::vector<std::string> take() {
    std::vector<std::string> texts;
    for (const Sent& each : std::exchange(sent, {})) {
      texts.push_back(each.text.substr(0, each.text.find('^')) +
                      (each.to == everyone ? "" : "@" + std::to_string(each.to)));
    }
    return texts;
  }

  std::optional<Problem> absence;  // the reason if the transport cannot be opened
  SendResult result = SendResult::sent;
  CarrierCounters counted;
  bool shared = false;
  bool keeps = true;  // keeps sent datagrams, which uses memory
  std::vector<Sent> sent;
  Peer held = everyone;
  std::vector<Peer> also_held;
};

class ScriptedBridge {
 public:
  using Texts = std::vector<std::string>;

  // `trusted`: passed to BridgeGuard.
  explicit ScriptedBridge(std::vector<Key> keys = {}, bool trusted = false) {
    BridgedPair::Setup setup;
    setup.keys = std::move(keys);
    setup.trusted = trusted;
    auto a = std::make_unique<ScriptedCarrier>();
    auto b = std::make_unique<ScriptedCarrier>();
    hosts = a.get();
    board = b.get();
    setup.hosts = std::move(a);
    setup.board = std::move(b);
    setup.now = [this] { return now; };
    setup.on_event = [this](BridgeSide side, const CarrierEvent& event) {
      events.push_back(std::string(side == BridgeSide::hosts ? "hosts " : "board ") +
                       to_text(event.kind));
    };
    pair = std::make_unique<BridgedPair>(std::move(setup));
  }

  // Advances the time while the loop runs.
  void pass(std::chrono::milliseconds time) {
    for (const auto end = now + time; now < end;) {
      now += std::min<std::chrono::steady_clock::duration>(WaitingTime::tick_interval, end - now);
      pair->tick();
    }
  }
  // Advances the time while the process is stopped.
  void sleep(std::chrono::milliseconds time) { now += time; }
  // The datagrams that have passed to the board since the last call, without the bridge's own W.
  Texts passed() {
    Texts texts = board->take();
    std::erase_if(texts, [](const std::string& text) { return text.starts_with("W:"); });
    return texts;
  }
  BridgeCounters from_hosts() const { return pair->status().hosts.from; }
  BridgeCounters from_board() const { return pair->status().board.from; }

  std::chrono::steady_clock::time_point now{std::chrono::hours(1)};
  ScriptedCarrier* hosts = nullptr;
  ScriptedCarrier* board = nullptr;
  Texts events;
  std::unique_ptr<BridgedPair> pair;
};

}  // namespace r4::test
