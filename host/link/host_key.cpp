// SPDX-License-Identifier: GPL-3.0-or-later
#include "host_key.hpp"

#include "../../protocol/messages/message.hpp"

namespace r4 {

const char* to_text(KeyTrouble trouble) {
  switch (trouble) {
    case KeyTrouble::none:
      break;
    case KeyTrouble::board_has_none:
      return "board has none";
    case KeyTrouble::needed:
      return "needed";
    case KeyTrouble::not_taken:
      return "not taken";
  }
  return "none";
}

bool HostKey::on_heartbeat(const Datagram& heartbeat) {
  const Text nonce = heartbeat_nonce(heartbeat);
  heard_ = true;
  asked_for_ = !nonce.empty();
  if (!asked_for_) in_vain_ = 0;
  return signer_ && signer_->on_nonce(nonce);
}

void HostKey::on_board_time(std::uint32_t t_ms, Time now) {
  if (signer_) signer_->on_board_time(t_ms, to_ms(now));
}

void HostKey::sign(DatagramWriter& writer, Time now) {
  if (!signer_ || !signer_->ready()) return;
  signer_->sign(writer, static_cast<std::uint64_t>((clock_start_ + now).count()), to_ms(now));
}

KeyTrouble HostKey::trouble(Time now) const {
  if (refuses_board()) return KeyTrouble::board_has_none;
  if (!asked_for_ || (in_vain_ < many && refused_until_ <= now)) return KeyTrouble::none;
  return has_key() ? KeyTrouble::not_taken : KeyTrouble::needed;
}

}  // namespace r4
