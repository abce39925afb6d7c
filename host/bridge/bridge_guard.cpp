// SPDX-License-Identifier: GPL-3.0-or-later
#include "bridge_guard.hpp"

#include <algorithm>

#include "waiting_time.hpp"

namespace r4 {
namespace {

// If the board's clock goes back by more than this, the board has restarted.
constexpr std::int32_t restarted_ms = -1500;

}  // namespace

BridgeGuard::BridgeGuard(const std::vector<Key>& keys, bool trusted)
    : authentication_(nullptr), trusted_(trusted) {
  Key all[max_keys];
  std::copy(keys.begin(), keys.end(), all);
  authentication_.use(all);
}

void BridgeGuard::on_board_datagram(const Datagram& datagram, MessageKind kind, Time now) {
  if (kind == MessageKind::board_heartbeat) {
    const Text nonce = heartbeat_nonce(datagram);
    heard_ = true;
    asks_ = !nonce.empty();
    if (authentication_.required()) authentication_.follow(nonce);
  }
  if (!authentication_.required() || !datagram.has_time()) return;
  const auto t_ms = static_cast<std::uint32_t>(datagram.time_ms());
  const auto ahead = static_cast<std::int32_t>(t_ms - board_ms(now));
  if (told_ && ahead < 0 && ahead > restarted_ms) return;  // the datagram was delayed
  t_ms_ = t_ms;
  told_ = now;
}

// Estimates as the host does (Signer), and never lower, because the host receives each T later.
std::uint32_t BridgeGuard::board_ms(Time now) const {
  const Time::duration passed = now - told_.value_or(now);
  return t_ms_ + ms_of(passed - passed / 32);
}

Verdict BridgeGuard::judge(const Datagram& datagram, Time now) {
  if (authentication_.required()) {
    return heard_ ? authentication_.verify(datagram, board_ms(now)) : Verdict::missing;
  }
  return !trusted_ || (heard_ && !asks_) ? Verdict::authentic : Verdict::missing;
}

BridgeGuard::Trouble BridgeGuard::trouble() const {
  if (!heard_) return Trouble::none;
  if (authentication_.required()) return asks_ ? Trouble::none : Trouble::board_has_no_key;
  return trusted_ && asks_ ? Trouble::key_needed : Trouble::none;
}

}  // namespace r4
