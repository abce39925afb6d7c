// SPDX-License-Identifier: GPL-3.0-or-later
// While a bridge serves no host, it watches its board (docs/reference/protocol.md, 4.8). Watchers
// at the hosts' side and programs that share the board's transport get the states. The bridge
// requests the rate and fields of its newest watcher. Without a watcher it requests a few states a
// second, a small load for a bus of many boards.
#pragma once

#include <chrono>
#include <cstdint>
#include <random>
#include <string>
#include <string_view>

#include "../paths/lease.hpp"
#include "r4link/datagram.hpp"
#include "r4link/messages/datagram_writer.hpp"

namespace r4 {

class BridgeWatch {
 public:
  using SteadyTime = std::chrono::steady_clock::time_point;
  static constexpr std::string_view idle_wish = "10";

  BridgeWatch() { wish_.reserve(max_datagram); }

  // The values of a watcher's W: the rate, and perhaps fields.
  void wish(Text values) { wish_.assign(values.data(), values.size()); }
  void wish_nothing() { wish_.clear(); }

  bool due(SteadyTime now) const { return lease_.due(time(now)); }
  Text write(DatagramWriter& writer, SteadyTime now) {
    lease_.sent(time(now));
    asked_ = true;
    return write_lease(writer, wish_.empty() ? idle_wish : std::string_view(wish_));
  }
  bool asked() const { return asked_; }
  Text write_end(DatagramWriter& writer) {
    asked_ = false;
    return write_lease(writer, "0");
  }

  // True if the refusal answers a W of this bridge. A W of a bridge names no session.
  bool on_refusal(const Nack& nack, SteadyTime now) {
    if (nack.sid != no_session || next_pnum_ - 1 - nack.pnum >= remembered) return false;
    if (nack.lease == 0) wish_nothing();  // the board rejects the wish
    lease_.on_refusal(nack, time(now));
    return true;
  }
  void on_state(SteadyTime now) { lease_.on_state(time(now)); }

 private:
  static constexpr std::uint32_t remembered = 16;

  static Time time(SteadyTime now) {
    return std::chrono::duration_cast<Time>(now.time_since_epoch());
  }
  Text write_lease(DatagramWriter& writer, std::string_view values) {
    return writer.field("W").values(values).finish(next_pnum_++, lease_.echo());
  }

  Lease lease_;
  std::string wish_;
  std::uint32_t next_pnum_ = std::random_device()();
  bool asked_ = false;
};

}  // namespace r4
