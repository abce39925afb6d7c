// SPDX-License-Identifier: GPL-3.0-or-later
// The host's key, and whether the board accepts it.
//
// With a key, every datagram is signed as soon as the board's nonce is known. A board without a
// nonce is refused: it has no key, and obeys anyone. A board that accepts no datagram of this host,
// because the host has no key or another key, does not say so: it takes no heartbeat, or answers
// AUTH.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

#include "../../protocol/keys/authentication.hpp"
#include "../measurement/time.hpp"
#include "r4link/link.hpp"

namespace r4 {

class HostKey {
 public:
  // `clock_start`: when that clock began, in microseconds since 1970.
  HostKey(const std::optional<Key>& key, Time clock_start) : clock_start_(clock_start) {
    if (key) signer_.emplace(*key);
  }

  // The board's newest heartbeat.
  void on_heartbeat(const Datagram& heartbeat);
  // The T of the board's newest datagram.
  void on_board_time(std::uint32_t t_ms, Time now);
  // The board has a host: this one or another.
  void on_host_seen(Time now) {
    in_vain_ = 0;
    host_seen_ = now;
  }
  // The reason in the board's newest heartbeat. `none`: the board has a host. `link`: it has none.
  // Any other reason hides whether the board still has the host that was seen last.
  void on_reason(SafeReason reason, Time now) {
    if (reason == SafeReason::none) on_host_seen(now);
    if (reason == SafeReason::link) host_seen_.reset();
    if (host_seen_ && now - *host_seen_ < host_memory) in_vain_ = 0;
  }
  // A heartbeat was sent.
  void on_heartbeat_sent() { in_vain_ += asked_for_ && in_vain_ < many ? 1 : 0; }
  // The board has answered AUTH to a datagram that the right key would have made acceptable.
  void on_refusal(Time now) { refused_until_ = now + refusal_memory; }

  bool has_key() const { return signer_.has_value(); }
  // True if the board asks for signatures. A board of the paper's release never does.
  bool asked_for() const { return asked_for_; }
  // True if only stops may be sent to the board.
  bool refuses_board() const { return has_key() && heard_ && !asked_for_; }
  // Signs the fields written so far, if there is a key and a nonce. finish() must follow.
  void sign(DatagramWriter& writer, Time now);

  // The problem with keys, if there is one.
  std::optional<LinkCause> cause(Time now) const;

 private:
  static constexpr int many = 10;  // heartbeats: one second of them
  static constexpr Time refusal_memory = std::chrono::seconds{1};
  // Longer than one second, the time between two states at the lowest rate.
  static constexpr Time host_memory = std::chrono::milliseconds{1500};

  std::optional<Signer> signer_;
  Time clock_start_;
  bool heard_ = false;      // a heartbeat has come
  bool asked_for_ = false;  // the newest heartbeat asks for signatures
  int in_vain_ = 0;         // heartbeats sent since the board was known to have a host
  std::optional<Time> host_seen_;
  Time refused_until_{0};
};

}  // namespace r4
