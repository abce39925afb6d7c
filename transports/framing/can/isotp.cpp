// SPDX-License-Identifier: GPL-3.0-or-later
#include "isotp.hpp"

#include <cstring>

namespace r4 {
namespace {

constexpr Text texts[] = {
    "none",
    "the bus did not accept a frame in time (N_As)",
    "flow control did not come in time (N_Bs)",
    "the next consecutive frame did not come in time (N_Cr)",
    "wrong sequence number",
    "interrupted by another transfer",
    "longer than the receiver's buffer",
    "reserved flow status",
    "too many waits (N_WFTmax)",
    "cancelled",
    "unexpected frame",
    "malformed frame",
};
constexpr std::size_t text_count = sizeof texts / sizeof texts[0];
static_assert(text_count == static_cast<std::size_t>(IsotpError::malformed) + 1,
              "a text for every error");

}  // namespace

Text to_text(IsotpError error) {
  const std::size_t index = static_cast<std::size_t>(error);
  return index < text_count ? texts[index] : Text("unknown error");
}

void isotp_frame::finish(CanFrame& frame, const IsotpChannel& channel, std::uint32_t id,
                         std::uint32_t used) {
  const std::uint32_t wanted = channel.padding && used < max_classic_size ? max_classic_size : used;
  frame.id = id;
  frame.size = can_frame_size(wanted);
  frame.fd = channel.fd;
  frame.extended = false;
  frame.remote = false;
  if (frame.size > used) std::memset(frame.data + used, channel.padding_byte, frame.size - used);
}

}  // namespace r4
