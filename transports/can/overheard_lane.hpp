// SPDX-License-Identifier: GPL-3.0-or-later
// Joins the frames of one CAN id to datagrams, and never answers.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "../framing/can/can_node.hpp"
#include "../framing/can/isotp_receiver.hpp"
#include "r4link/messages/packed_form.hpp"

namespace r4 {

class OverheardLane {
 public:
  OverheardLane(CanIdKind kind, std::uint8_t node)
      : receiver_(listening_to(kind, node), bytes_.data(), max_datagram) {}

  // The completed datagram in plain form, valid until the next call. An empty Text: the datagram
  // cannot be unpacked.
  std::optional<Text> on_frame(const CanFrame& frame, std::uint32_t at_us) {
    if (!receiver_.on_frame(frame, at_us).datagram) return std::nullopt;
    if (!is_packed(receiver_.data()[0])) return receiver_.text();
    const UnpackResult result =
        unpack(receiver_.data(), receiver_.size(), plain_.data(), plain_.size());
    return result ? Text(plain_.data(), result.size) : Text();
  }
  const IsotpReceiverCounters& counters() const { return receiver_.counters(); }

 private:
  std::array<std::uint8_t, max_datagram> bytes_;
  std::array<char, max_datagram> plain_;
  IsotpReceiver receiver_;
};

}  // namespace r4
