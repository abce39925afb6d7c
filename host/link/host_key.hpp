// SPDX-License-Identifier: GPL-3.0-or-later
// The host's key, and whether the board accepts it.
// With a key, every datagram is signed as soon as the board's nonce is known. A board without a
// nonce has no key and obeys any host, so a host with a key refuses the board. If the board rejects
// this host's key, or requires a key that this host lacks, the board accepts no heartbeats or
// answers AUTH.
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
  // `clock_start`: the zero of the session's clock, in microseconds since 1970.
  HostKey(const std::optional<Key>& key, Time clock_start) : clock_start_(clock_start) {
    if (key) signer_.emplace(*key);
  }

  void on_heartbeat(const Datagram& heartbeat);
  void on_board_time(std::uint32_t t_ms, Time now) {
    if (signer_) signer_->on_board_time(t_ms, to_ms(now));
  }
  void on_host_seen(Time now) {
    in_vain_ = 0;
    host_seen_ = now;
  }
  // `reason`: of the newest heartbeat. `none`: the board has a host. `link`: it has no host.
  void on_reason(SafeReason reason, Time now) {
    if (reason == SafeReason::none) on_host_seen(now);
    if (reason == SafeReason::link) host_seen_.reset();
    if (host_seen_ && now - *host_seen_ < host_memory) in_vain_ = 0;
  }
  void on_heartbeat_sent() { in_vain_ += asked_for_ && in_vain_ < many ? 1 : 0; }
  // The board has answered AUTH to a datagram that it accepts only with a valid signature.
  void on_refusal(Time now) { refused_until_ = now + refusal_memory; }

  bool has_key() const { return signer_.has_value(); }
  // True if the board requires signatures. Boards of the paper's release never do.
  bool asked_for() const { return asked_for_; }
  // True if only stops may be sent to the board.
  bool refuses_board() const { return has_key() && heard_ && !asked_for_; }
  // Signs the written fields if there is a key and a nonce. finish() must follow.
  void sign(DatagramWriter& writer, Time now);

  std::optional<LinkCause> cause(Time now) const;

 private:
  static constexpr int many = 10;  // one second of heartbeats
  static constexpr Time refusal_memory = std::chrono::seconds{1};
  // Longer than 1 s, the time between two states at the lowest rate.
  static constexpr Time host_memory = std::chrono::milliseconds{1500};

  std::optional<Signer> signer_;
  Time clock_start_;
  bool heard_ = false;
  bool asked_for_ = false;  // the newest heartbeat requires signatures
  int in_vain_ = 0;         // heartbeats sent since the board last had a host
  std::optional<Time> host_seen_;
  Time refused_until_{0};
};

}  // namespace r4
