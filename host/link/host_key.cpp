// SPDX-License-Identifier: GPL-3.0-or-later
#include "host_key.hpp"

#include "../../protocol/messages/message.hpp"

namespace r4 {

void HostKey::on_heartbeat(const Datagram& heartbeat) {
  const Text nonce = heartbeat_nonce(heartbeat);
  heard_ = true;
  asked_for_ = !nonce.empty();
  if (!asked_for_) in_vain_ = 0;
  if (signer_) signer_->on_nonce(nonce);
}

void HostKey::sign(DatagramWriter& writer, Time now) {
  if (!signer_ || !signer_->ready()) return;
  signer_->sign(writer, static_cast<std::uint64_t>((clock_start_ + now).count()), to_ms(now));
}

std::optional<LinkCause> HostKey::cause(Time now) const {
  if (refuses_board()) return LinkCause::board_has_no_key;
  if (!asked_for_ || (in_vain_ < many && refused_until_ <= now)) return std::nullopt;
  return has_key() ? LinkCause::key_not_taken : LinkCause::key_needed;
}

}  // namespace r4
