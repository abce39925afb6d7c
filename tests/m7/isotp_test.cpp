// SPDX-License-Identifier: GPL-3.0-or-later
// ISO-TP on the board: the sender splits a datagram into frames, and the receiver joins them.
#include "on_target.hpp"
#include "r4link/datagram.hpp"
#include "transports/framing/can/isotp_receiver.hpp"
#include "transports/framing/can/isotp_sender.hpp"

namespace {

using namespace r4;

IsotpChannel channel() {
  IsotpChannel channel;
  channel.id = 0x201;
  channel.flow_control_id = 0x301;
  return channel;
}

// Moves frames between both ends until the transfer ends, without frame `lost` (0: none). True if
// the datagram arrived.
bool arrives(Text datagram, std::uint32_t lost) {
  IsotpSenderOptions sending;
  sending.channel = channel();
  IsotpReceiverOptions receiving;
  receiving.channel = channel();
  std::uint8_t buffer[max_datagram];
  IsotpSender sender(sending);
  IsotpReceiver receiver(receiving, buffer, sizeof buffer);
  std::uint32_t frames = 0;
  bool whole = false;
  sender.begin(datagram, 0);
  for (std::uint32_t now_us = 0; now_us < 100000; now_us += 100) {
    CanFrame frame;
    if (sender.offer(now_us, frame)) {
      sender.frame_sent(now_us);
      if (++frames != lost && receiver.on_frame(frame, now_us).datagram) {
        whole = receiver.text() == datagram;
      }
    }
    if (receiver.offer(now_us, frame)) {
      receiver.frame_sent(now_us);
      sender.on_frame(frame, now_us);
    }
    sender.poll(now_us);
    receiver.poll(now_us);
  }
  return whole && !sender.busy() && !receiver.busy();
}

}  // namespace

TEST(Isotp, ReassemblesTheDatagramsItSegmented) {
  static char bytes[max_datagram];
  for (std::size_t i = 0; i < sizeof bytes; ++i) bytes[i] = static_cast<char>(i * 7);
  const std::size_t sizes[] = {1, 7, 8, 62, 154, 170, max_datagram};
  for (const std::size_t size : sizes) EXPECT(arrives(Text(bytes, size), 0));
}

TEST(Isotp, DeliversNothingWhenAFrameIsLost) {
  static char bytes[170];
  for (std::uint32_t lost = 1; lost <= 25; ++lost)
    EXPECT(!arrives(Text(bytes, sizeof bytes), lost));
}
