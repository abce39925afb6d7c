// SPDX-License-Identifier: GPL-3.0-or-later
// Any frames at any times: a sender and a receiver, each with arbitrary options, keep their
// promises. The input is a list of actions; what the options are is in its first bytes.
#include <cstdint>
#include <cstring>
#include <vector>

#include "tests/fuzz/input.hpp"
#include "transports/framing/isotp_receiver.hpp"
#include "transports/framing/isotp_sender.hpp"

namespace r4 {
namespace {

constexpr std::uint32_t longest_wait_us = 127000;  // of the options below, STmin included

std::uint32_t time_from(Input& input) { return 1 + input.word() % longest_wait_us; }

class Fuzz {
 public:
  explicit Fuzz(Input& input)
      : input_(input),
        capacity_(input.word() % 6000),
        // On the heap and of just that size: one byte beyond it is caught.
        buffer_(capacity_),
        datagram_(input.word() % 6000),
        sender_(sender_options()),
        receiver_(receiver_options(), buffer_.data(), capacity_) {
    for (std::size_t i = 0; i < datagram_.size(); ++i) datagram_[i] = static_cast<std::uint8_t>(i);
  }

  void run() {
    now_us_ = input_.word() << 16;
    while (!input_.empty()) {
      act();
      check_deadlines();
      check_sender();
      check_receiver();
    }
  }

 private:
  IsotpChannel channel() {
    IsotpChannel channel;
    const std::uint8_t flags = input_.byte();
    channel.id = 1;
    channel.flow_control_id = 2;
    channel.fd = (flags & 1) != 0;
    channel.padding = (flags & 2) != 0;
    return channel;
  }
  IsotpSenderOptions sender_options() {
    IsotpSenderOptions options;
    options.channel = channel();
    options.tx_dl = input_.byte();
    options.flow_control = (input_.byte() & 1) != 0;
    options.separation_us = time_from(input_);
    options.n_as_us = time_from(input_);
    options.n_bs_us = time_from(input_);
    options.max_waits = input_.byte();
    return options;
  }
  IsotpReceiverOptions receiver_options() {
    IsotpReceiverOptions options;
    options.channel = channel();
    options.listen_only = (input_.byte() & 1) != 0;
    options.block_size = input_.byte();
    options.stmin = input_.byte();
    options.n_ar_us = time_from(input_);
    options.n_cr_us = time_from(input_);
    options.wait_gap_us = time_from(input_);
    options.max_waits = input_.byte();
    return options;
  }

  void act() {
    const std::uint8_t action = input_.byte();
    switch (action % 8) {
      case 0:
        now_us_ += input_.word();
        break;
      case 1:
        sender_.begin(datagram_.data(), static_cast<std::uint32_t>(datagram_.size()), now_us_);
        break;
      case 2:
      case 3:
        take_foreign(action);
        break;
      case 4:
      case 5:
        exchange((action & 0x80) == 0);
        break;
      case 6:
        receiver_.hold((action & 0x80) != 0, now_us_);
        break;
      default:
        if ((action & 0xF8) == 0) {
          sender_.cancel();
          receiver_.cancel();
        } else {
          sender_.frame_sent(now_us_);
          receiver_.frame_sent(now_us_);
        }
    }
  }

  void take_foreign(std::uint8_t action) {
    CanFrame frame;
    std::memset(&frame, 0x55, sizeof frame);
    frame.id = 1 + (action >> 3 & 1);
    frame.fd = (action & 0x10) != 0;
    frame.extended = (action & 0xE0) == 0x20;
    frame.remote = (action & 0xE0) == 0x40;
    frame.size = input_.byte();
    for (std::uint8_t i = 0; i < 8 && i < frame.size; ++i) frame.data[i] = input_.byte();
    take(frame);
  }

  // Moves frames between the two, or only offers them.
  void exchange(bool accepted) {
    CanFrame frame;
    for (int i = 0; i < 20; ++i) {
      bool moved = false;
      if (sender_.offer(now_us_, frame)) {
        require(has_valid_size(frame) && frame.size != 0 && frame.id == 1);
        if (accepted) sender_.frame_sent(now_us_);
        if (accepted) take(frame);
        moved = accepted;
      }
      if (receiver_.offer(now_us_, frame)) {
        require(has_valid_size(frame) && frame.size >= 3 && frame.id == 2);
        if (accepted) receiver_.frame_sent(now_us_);
        if (accepted) take(frame);
        moved = moved || accepted;
      }
      if (!moved) return;
    }
  }

  void take(const CanFrame& frame) {
    sender_.on_frame(frame, now_us_);
    const IsotpArrival arrival = receiver_.on_frame(frame, now_us_);
    if (!arrival.datagram) return;
    require(receiver_.size() != 0 && receiver_.size() <= capacity_);
    require(!receiver_.busy());
  }

  // After poll(), what is armed lies ahead, or the end itself has something to offer.
  void check_deadlines() {
    sender_.poll(now_us_);
    receiver_.poll(now_us_);
    require(sender_.deadline().armed == sender_.busy());
    require(receiver_.deadline().armed || !receiver_.busy());
    check_deadline(sender_);
    check_deadline(receiver_);
  }
  template <class End>
  void check_deadline(const End& end) const {
    const IsotpDeadline deadline = end.deadline();
    if (!deadline.armed) return;
    if (reached(now_us_, deadline.at_us)) {
      CanFrame frame;
      require(End(end).offer(now_us_, frame));
    } else {
      require(deadline.at_us - now_us_ <= longest_wait_us);
    }
  }

  void check_sender() const {
    const IsotpSenderCounters& c = sender_.counters();
    require(c.started == c.datagrams + c.send_timeout + c.flow_control_timeout + c.overflow +
                             c.invalid_flow_status + c.too_many_waits + c.cancelled +
                             sender_.busy());
    require(sender_.busy() || c.started != 0 || sender_.error() == IsotpError::none);
  }
  void check_receiver() const {
    const IsotpReceiverCounters& c = receiver_.counters();
    require(c.started == c.datagrams + c.send_timeout + c.consecutive_timeout +
                             c.wrong_sequence_number + c.interrupted + c.too_many_waits +
                             c.cancelled + receiver_.busy());
    require(c.frames == c.started + c.consecutive + c.wrong_sequence_number + c.overflow +
                            c.unexpected_frame + c.malformed);
  }

  Input& input_;
  std::uint32_t capacity_;
  std::vector<std::uint8_t> buffer_;
  std::vector<std::uint8_t> datagram_;
  IsotpSender sender_;
  IsotpReceiver receiver_;
  std::uint32_t now_us_ = 0;
};

}  // namespace
}  // namespace r4

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  r4::Input input(data, size);
  r4::Fuzz(input).run();
  return 0;
}
