// SPDX-License-Identifier: GPL-3.0-or-later
// Runs our engine frame by frame over a raw socket, as a carrier does, until the end of one
// transfer.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <random>
#include <string>

#include "tests/transports/can/kernel/kernel_isotp.hpp"
#include "tests/transports/can/kernel/raw_can.hpp"
#include "transports/framing/can/isotp_receiver.hpp"
#include "transports/framing/can/isotp_sender.hpp"

namespace r4::test {

constexpr std::uint32_t data_id = 0x180;
constexpr std::uint32_t flow_control_id = 0x200;
// The emulated machine is slow and shares its processors, so limits that are not under test are
// long.
constexpr std::uint32_t patience_us = 2000000;
// The time from the call to the first frame, which another program may send.
constexpr std::uint32_t start_limit_us = 10000000;

// The lengths to test: each length at which single frames end or sequence numbers restart. Also
// every 17th length, so that last frames of all sizes occur, and lengths that need a 32-bit first
// frame. Isotp.EveryLengthInEveryFrameLengthArrives tests all lengths, without a bus.
constexpr std::uint32_t next_length(std::uint32_t size) {
  if (size < 136 || size == 4095 || size == 4096) return size + 1;
  return size < 1024 ? std::min(size + 17, 1024U) : size == 1024 ? 4095 : 8200;
}
constexpr std::uint32_t longest_length = 8200;

// The form of the frames of both ends.
struct Form {
  const char* name;
  std::uint8_t tx_dl;
  bool padding;
};
constexpr Form forms[] = {
    {"Classic", 8, false}, {"ClassicPadded", 8, true}, {"Fd", 64, false}, {"FdPadded", 64, true}};
constexpr Form classic = forms[0];

inline IsotpChannel channel_of(const Form& form) {
  IsotpChannel channel;
  channel.id = data_id;
  channel.flow_control_id = flow_control_id;
  channel.fd = form.tx_dl > max_classic_size;
  channel.padding = form.padding;
  return channel;
}

inline IsotpSenderOptions sender_of(const Form& form) {
  IsotpSenderOptions options;
  options.channel = channel_of(form);
  options.tx_dl = form.tx_dl;
  options.n_as_us = options.n_bs_us = patience_us;
  return options;
}

inline IsotpReceiverOptions receiver_of(const Form& form) {
  IsotpReceiverOptions options;
  options.channel = channel_of(form);
  options.n_ar_us = options.n_cr_us = patience_us;
  return options;
}

// The kernel checks the length of each frame of our engine and, in a padded form, the padding.
inline KernelIsotpOptions kernel_of(const Form& form) {
  KernelIsotpOptions options;
  options.tx_dl = form.tx_dl;
  options.flags = CAN_ISOTP_CHK_PAD_LEN;
  if (form.padding) {
    options.flags |= CAN_ISOTP_CHK_PAD_DATA | CAN_ISOTP_TX_PADDING | CAN_ISOTP_RX_PADDING;
  }
  return options;
}

// Pseudo-random bytes. Each size has its own sequence.
inline std::string content_of(std::uint32_t size) {
  std::mt19937 random(size);
  std::string bytes(size, '\0');
  for (char& byte : bytes) byte = static_cast<char>(random());
  return bytes;
}

// True if data frame number n (from 0) is lost. A test may also act at that time.
using Lost = std::function<bool(unsigned)>;
inline bool none_lost(unsigned /*frame*/) { return false; }

struct Course {
  IsotpError error = IsotpError::none;      // the end of the transfer
  unsigned frames = 0;                      // data frames
  unsigned answers = 0;                     // flow controls
  std::uint32_t least_gap_us = UINT32_MAX;  // between data frames without flow control between them
  std::uint32_t took_us = 0;                // from the first frame to the end
  std::uint32_t silence_us = 0;             // from the last frame to the end
};

inline Course drive(RawCan& bus, IsotpSender& sender, const std::string& datagram,
                    const Lost& lost = none_lost) {
  Course course;
  const std::uint32_t began_us = clock_us();
  std::uint32_t last_us = began_us;
  bool follows = false;  // the last frame was a data frame, not an answer
  sender.begin(datagram.data(), static_cast<std::uint32_t>(datagram.size()), began_us);
  CanFrame frame;
  while (sender.busy()) {
    const std::uint32_t now_us = clock_us();
    if (sender.offer(now_us, frame)) {
      if (follows) course.least_gap_us = std::min(course.least_gap_us, now_us - last_us);
      follows = true;
      if (!lost(course.frames++)) bus.send(frame);
      last_us = clock_us();
      sender.frame_sent(last_us);
    } else if (sender.busy() && bus.receive(frame, sender.deadline().at_us)) {
      sender.on_frame(frame, clock_us());
      ++course.answers;
      follows = false;
    } else {
      sender.poll(clock_us());
    }
  }
  course.error = sender.error();
  course.took_us = clock_us() - began_us;
  course.silence_us = clock_us() - last_us;
  return course;
}

// Runs until a transfer ends, with or without an error. N_Cr and other limits are options of the
// receiver. If no transfer begins within start_limit_us, the course has no frames.
inline Course drive(RawCan& bus, IsotpReceiver& receiver, const Lost& lost = none_lost) {
  Course course;
  std::uint32_t first_us = clock_us();
  std::uint32_t last_us = first_us;
  const std::uint32_t until_us = first_us + start_limit_us;
  bool ended = false;
  CanFrame frame;
  const auto note = [&](const IsotpArrival& arrival) {
    if (arrival.datagram) ended = true;
    const bool ignored =
        arrival.error == IsotpError::unexpected_frame || arrival.error == IsotpError::malformed;
    if (arrival.error == IsotpError::none || ignored) return;
    if (course.error == IsotpError::none) course.error = arrival.error;
    ended = true;
  };
  for (;;) {
    note({false, receiver.poll(clock_us())});
    const IsotpDeadline deadline = receiver.deadline();
    if (ended && !deadline.armed) break;
    if (receiver.offer(clock_us(), frame)) {
      bus.send(frame);
      receiver.frame_sent(clock_us());
      ++course.answers;
    } else if (bus.receive(frame, deadline.armed ? deadline.at_us : until_us)) {
      last_us = clock_us();
      if (course.frames == 0) first_us = last_us;
      if (!lost(course.frames++)) note(receiver.on_frame(frame, last_us));
    } else if (!deadline.armed) {
      break;
    }
  }
  course.took_us = clock_us() - first_us;
  course.silence_us = clock_us() - last_us;
  return course;
}

}  // namespace r4::test
