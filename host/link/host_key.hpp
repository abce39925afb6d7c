// SPDX-License-Identifier: GPL-3.0-or-later
// The host's key, and what its board makes of it.
//
// With a key everything is signed as soon as the board's nonce is known, and a board that tells
// none is refused: it has no key and obeys anyone. That a board takes nothing of ours, for we have
// no key or another one, is found out by what it does not do: it takes no heartbeat, or answers AUTH.
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

  // The board's newest heartbeat. True if we sign and its nonce is another: the board has been safe
  // since, and our session may have ended.
  bool on_heartbeat(const Datagram& heartbeat);
  // The T of its newest datagram.
  void on_board_time(std::uint32_t t_ms, Time now);
  // The board has a host, whoever that is.
  void on_host_seen(Time now) {
    in_vain_ = 0;
    host_seen_ = now;
  }
  // What the board's newest heartbeat says of it: none, and it has a host; link, and it has none. Any
  // other reason hides whether it still has the one that was seen last.
  void on_reason(SafeReason reason, Time now) {
    if (reason == SafeReason::none) on_host_seen(now);
    if (reason == SafeReason::link) host_seen_.reset();
    if (host_seen_ && now - *host_seen_ < host_memory) in_vain_ = 0;
  }
  // A heartbeat was sent.
  void on_heartbeat_sent() { in_vain_ += asked_for_ && in_vain_ < many ? 1 : 0; }
  // It has answered AUTH to something that a key would have made good.
  void on_refusal(Time now) { refused_until_ = now + refusal_memory; }

  bool has_key() const { return signer_.has_value(); }
  // The board asks for a signature: it is none of the paper's release.
  bool asked_for() const { return asked_for_; }
  // To that board nothing may be sent but stops.
  bool refuses_board() const { return has_key() && heard_ && !asked_for_; }
  // Signs what is written, if there is a key and a nonce; finish() is to follow.
  void sign(DatagramWriter& writer, Time now);

  // What is wrong with keys.
  std::optional<LinkCause> cause(Time now) const;

 private:
  static constexpr int many = 10;  // heartbeats: a second of them
  static constexpr Time refusal_memory = std::chrono::seconds{1};
  // More than a second: from a state to the next at the lowest rate.
  static constexpr Time host_memory = std::chrono::milliseconds{1500};

  std::optional<Signer> signer_;
  Time clock_start_;
  bool heard_ = false;      // a heartbeat
  bool asked_for_ = false;  // a signature, by that heartbeat
  int in_vain_ = 0;         // heartbeats sent since the board was known to have a host
  std::optional<Time> host_seen_;
  Time refused_until_{0};
};

}  // namespace r4
