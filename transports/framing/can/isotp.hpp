// SPDX-License-Identifier: GPL-3.0-or-later
// Datagrams on a CAN bus: ISO 15765-2:2016 with normal addressing ("ISO-TP"). Part of both ends.
//     single frame       0L data…               up to 7 bytes; 00 LL data… in a longer FD frame
//     first frame        1L LL data…            8–4095 bytes; 10 00 LL LL LL LL data… for more
//     consecutive frame  2S data…               S counts 1 … 15, 0, 1 …
//     flow control       3F BS ST               F: 0 clear to send, 1 wait, 2 overflow
// Both ends are driven frame by frame and own no clock, no heap and no bus:
//     on_frame(frame, now)   a frame arrived; frames of other ids are ignored
//     offer(now, frame)      true if there is a frame to send; the same frame is offered until …
//     frame_sent(now)        … the bus, or the queue before it, has accepted it; no effect
//                            without an offered frame
//     deadline()             when to call poll() and offer() again, so that a loop needs one timer
//     poll(now)              ends a timed-out transfer; so do on_frame(), and offer() for its frame
// Call frame_sent() before on_frame() for later arrivals. A full queue costs time, but never a
// frame within a transfer. Times are us and wrap; time-outs are below 2^31 us. Not thread-safe.
#pragma once

#include <cstdint>

#include "../../../protocol/datagram/wrapping.hpp"
#include "r4link/can/can_frame.hpp"
#include "r4link/text.hpp"

namespace r4 {

enum class IsotpError : std::uint8_t {
  none,
  send_timeout,           // ends: the bus did not accept the frame within N_As or N_Ar (9.8.2)
  flow_control_timeout,   // ends: no flow control within N_Bs (9.8.2)
  consecutive_timeout,    // ends: no consecutive frame within N_Cr (9.8.2)
  wrong_sequence_number,  // ends: a consecutive frame was lost, duplicated or overtaken (9.6.4.4)
  interrupted,            // ends: another single or first frame arrived; it is accepted (9.8.3)
  overflow,               // ends: longer than the receiver's buffer (9.6.3.2, 9.6.5.1)
  invalid_flow_status,    // ends: a reserved flow status (9.6.5.2)
  too_many_waits,         // ends: more waits, received or sent, than N_WFTmax (9.7, 9.8.4)
  cancelled,
  unexpected_frame,  // ignored: an unexpected consecutive frame or flow control (9.8.3)
  malformed,         // ignored: length or type not valid for any frame (9.6.2.2, 9.6.3.2)
};

Text to_text(IsotpError error);

struct IsotpChannel {
  std::uint32_t id = 0;               // single, first and consecutive frames; 11 bits
  std::uint32_t flow_control_id = 0;  // the receiver's flow control; 11 bits
  bool fd = false;                    // send FD frames; both formats are received
  bool padding = false;               // fill short frames up to 8 bytes (10.4.2.1)
  std::uint8_t padding_byte = 0xCC;   // also between 8 and the next FD size (10.4.2.3)
};

// When to call poll() and offer() again. If not armed, no call is needed before another event.
struct IsotpDeadline {
  bool armed;
  std::uint32_t at_us;
};

// The gap between consecutive frames for an STmin byte (9.6.5.4): 0–127 ms, or 100–900 us for
// 0xF1–0xF9. Reserved values mean the longest gap, 127 ms (9.6.5.5).
constexpr std::uint32_t stmin_to_us(std::uint8_t stmin) {
  return stmin <= 0x7F                    ? stmin * 1000U
         : stmin >= 0xF1 && stmin <= 0xF9 ? (stmin - 0xF0U) * 100U
                                          : 127000U;
}

// The STmin byte for a gap of at least `us`; 127 ms for longer gaps.
constexpr std::uint8_t stmin_from_us(std::uint32_t us) {
  return us == 0        ? 0
         : us <= 900    ? static_cast<std::uint8_t>(0xF0U + (us + 99) / 100)
         : us <= 126000 ? static_cast<std::uint8_t>((us + 999) / 1000)
                        : 0x7F;
}

// Values in frames (9.6.1, 9.6.5.1).
enum class IsotpFrameType : std::uint8_t { single, first, consecutive, flow_control };
enum class IsotpFlowStatus : std::uint8_t { clear_to_send, wait, overflow };
constexpr std::uint32_t max_short_first_frame = 4095;  // FF_DL in 12 bits; 32 bits for more

namespace isotp_frame {

constexpr bool is_for(const CanFrame& frame, std::uint32_t id) {
  return frame.id == id && !frame.extended && !frame.remote;
}

// Byte 0: the type, and four bits whose meaning depends on it.
constexpr std::uint8_t control(IsotpFrameType type, std::uint32_t low) {
  return static_cast<std::uint8_t>(static_cast<std::uint32_t>(type) << 4 | (low & 0xF));
}

constexpr bool is_flow_control(const CanFrame& frame) {
  return frame.size != 0 && frame.data[0] >> 4 == static_cast<int>(IsotpFrameType::flow_control);
}

// Completes a frame with `used` bytes of data: id, format, padding and size.
void finish(CanFrame& frame, const IsotpChannel& channel, std::uint32_t id, std::uint32_t used);

}  // namespace isotp_frame
}  // namespace r4
