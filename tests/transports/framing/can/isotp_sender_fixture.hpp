// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "tests/transports/framing/can/can_frames.hpp"
#include "transports/framing/can/isotp_sender.hpp"

namespace r4::test {

using Frames = std::vector<std::string>;

inline constexpr std::uint32_t id = 0x180;
inline constexpr std::uint32_t flow_control_id = 0x200;

inline IsotpSenderOptions classic() {
  IsotpSenderOptions options;
  options.channel.id = id;
  options.channel.flow_control_id = flow_control_id;
  return options;
}

inline IsotpSenderOptions burst() {
  IsotpSenderOptions options = classic();
  options.flow_control = false;
  return options;
}

inline IsotpSenderOptions fd(std::uint8_t tx_dl) {
  IsotpSenderOptions options = classic();
  options.channel.fd = true;
  options.tx_dl = tx_dl;
  return options;
}

// A sender in virtual time, on a bus that accepts every frame at once.
struct Sender : IsotpSender {
  explicit Sender(const IsotpSenderOptions& options, std::uint32_t start_us = 0)
      : IsotpSender(options), now(start_us) {}

  Frames take() {
    Frames frames;
    CanFrame frame;
    while (offer(now, frame)) {
      EXPECT_EQ(frame.id, id);
      EXPECT_TRUE(has_valid_size(frame));
      EXPECT_FALSE(frame.extended || frame.remote);
      frames.push_back(hex_of(frame));
      frame_sent(now);
    }
    return frames;
  }
  bool start(const std::string& datagram) {
    bytes = datagram;
    return begin(bytes, now);
  }
  IsotpError answer(const std::string& hex) {
    return on_frame(frame_of(flow_control_id, hex), now);
  }

  std::uint32_t now;
  std::string bytes;
};

// Each started transfer is counted by exactly one result, or is under way.
inline void expect_counters_add_up(const IsotpSender& sender) {
  const IsotpSenderCounters& c = sender.counters();
  EXPECT_EQ(c.started, c.datagrams + c.send_timeout + c.flow_control_timeout + c.overflow +
                           c.invalid_flow_status + c.too_many_waits + c.cancelled + sender.busy());
}

}  // namespace r4::test
