// SPDX-License-Identifier: GPL-3.0-or-later
// What other hosts send to a board on its command id: their frames joined to datagrams, without taking part.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "../framing/can/can_node.hpp"
#include "../framing/can/isotp_receiver.hpp"
#include "../framing/can/packed_form.hpp"

namespace r4 {

class OverheardCommands {
 public:
  explicit OverheardCommands(std::uint8_t node)
      : receiver_(listening_to(CanIdKind::command, node), bytes_.data(), max_datagram) {}

  // Returns the datagram that the frame completes, in plain form and valid up to the next call; or nothing.
  std::string_view on_frame(const CanFrame& frame, std::uint32_t at_us) {
    if (!receiver_.on_frame(frame, at_us).datagram) return {};
    const Text text = receiver_.text();
    if (!is_packed(receiver_.data()[0])) return {text.data(), text.size()};
    const UnpackResult result =
        unpack(receiver_.data(), receiver_.size(), plain_.data(), plain_.size());
    return {plain_.data(), result ? result.size : 0};
  }

 private:
  std::array<std::uint8_t, max_datagram> bytes_;
  std::array<char, max_datagram> plain_;
  IsotpReceiver receiver_;
};

}  // namespace r4
