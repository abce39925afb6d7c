// SPDX-License-Identifier: GPL-3.0-or-later
// Any frames at any times: a sender and a receiver with arbitrary options keep their promises. The
// first bytes of the input are the options, the rest is a list of actions.
//
// If the sender's frames are lost and no frame is added, the receiver delivers only datagrams that
// were sent. There is one exception, because a sequence number has four bits: the receiver may join
// two datagrams if it received no frame across their border. With flow control on both sides, the
// exception occurs only if flow control arrives when its sender has begun the next datagram.
#include <cstdint>
#include <cstring>
#include <vector>

#include "tests/fuzz/input.hpp"
#include "transports/framing/can/isotp_receiver.hpp"
#include "transports/framing/can/isotp_sender.hpp"

namespace r4 {
namespace {

// The longest wait with the options below, STmin included.
constexpr std::uint32_t longest_wait_us = 127000;

std::uint32_t time_from(Input& input) { return 1 + input.word() % longest_wait_us; }

class Fuzz {
 public:
  explicit Fuzz(Input& input)
      : input_(input),
        capacity_(input.word() % 6000),
        // The buffer is on the heap and has exactly this size, so that a sanitizer finds an access
        // beyond the buffer.
        buffer_(capacity_),
        datagram_(input.word() % 6000),
        sender_(sender_options()),
        receiver_(receiver_options(), buffer_.data(), capacity_) {}

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
    controlled_ = options.flow_control;
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
    listens_only_ = options.listen_only;
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
        begin(action);
        break;
      case 2:
      case 3:
        take_foreign(action);
        break;
      case 4:
      case 5:
        exchange((action & 0x80) == 0, (action & 0x40) != 0 ? input_.word() : 0);
        break;
      case 6:
        receiver_.hold((action & 0x80) != 0, now_us_);
        break;
      default:
        if ((action & 0xF8) == 0) {
          sender_.cancel();
          receiver_.cancel();
        } else {
          accept();
          receiver_.frame_sent(now_us_);
        }
    }
  }

  // All bytes of a datagram are its number. At most 15 bytes of the buffer are unused.
  void begin(std::uint8_t action) {
    if (sender_.busy() || datagram_.empty()) return;
    const std::size_t less = action >> 4;
    const std::size_t size = less < datagram_.size() ? datagram_.size() - less : datagram_.size();
    std::memset(datagram_.data(), ++number_, size);
    require(sender_.begin(datagram_.data(), static_cast<std::uint32_t>(size), now_us_));
    size_ = static_cast<std::uint32_t>(size);
    accepted_ = 0;
    gap_us_ = 0;
  }

  void take_foreign(std::uint8_t action) {
    any_foreign_ = true;
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

  // Moves frames between the two ends, or only offers the frames. A frame whose bit of `lost` is
  // set is lost.
  void exchange(bool accepted, std::uint32_t lost) {
    CanFrame frame;
    for (int i = 0; i < 20; ++i) {
      bool moved = false;
      if (sender_.offer(now_us_, frame)) {
        require(has_valid_size(frame) && frame.size != 0 && frame.id == 1);
        if (accepted) accept();
        if (accepted && (lost >> (i % 16) & 1) == 0) take_own(frame);
        moved = accepted;
      }
      if (receiver_.offer(now_us_, frame)) {
        require(has_valid_size(frame) && frame.size >= 3 && frame.id == 2);
        if (accepted) receiver_.frame_sent(now_us_);
        if (accepted && (lost >> ((i + 5) % 16) & 1) == 0) {
          flow_control_late_ = flow_control_late_ || heard_number_ != number_;
          take(frame);
        }
        moved = moved || accepted;
      }
      if (!moved) return;
    }
  }

  // The bus takes the sender's frame. The sender keeps STmin between two consecutive frames.
  void accept() {
    const std::uint32_t before = sender_.counters().frames;
    sender_.frame_sent(now_us_);
    if (sender_.counters().frames == before) return;
    if (++accepted_ > 2) require(now_us_ - accepted_us_ >= gap_us_);
    accepted_us_ = now_us_;
  }

  // The receiver gets a frame of the sender.
  void take_own(const CanFrame& frame) {
    const bool consecutive = frame.data[0] >> 4 == static_cast<int>(IsotpFrameType::consecutive);
    if (!consecutive) {
      heard_number_ = number_;
      next_ = 1;
      in_order_ = true;
      flow_control_late_ = false;
    }
    const std::uint32_t malformed = receiver_.counters().malformed;
    const std::uint32_t unexpected = receiver_.counters().unexpected_frame;
    const std::uint32_t delivered = receiver_.counters().datagrams;
    take(frame);
    // A consecutive frame that is not expected belongs to no datagram.
    if (consecutive && receiver_.counters().unexpected_frame == unexpected) {
      in_order_ = in_order_ && (frame.data[0] & 0xF) == next_;
      if (receiver_.counters().malformed == malformed) next_ = (next_ + 1) & 0xF;
    }
    if (receiver_.counters().datagrams == delivered || any_foreign_) return;
    require(in_order_);
    if (controlled_ && !listens_only_ && !flow_control_late_) require(is_of_the_sender());
  }
  bool is_of_the_sender() const {
    if (receiver_.size() != size_) return false;
    for (std::uint32_t i = 0; i < size_; ++i) {
      if (receiver_.data()[i] != number_) return false;
    }
    return true;
  }

  void take(const CanFrame& frame) {
    const bool waits = sender_.awaits_flow_control();
    const IsotpError error = sender_.on_frame(frame, now_us_);
    if (waits && error == IsotpError::none && !sender_.awaits_flow_control()) {
      gap_us_ = stmin_to_us(frame.data[2]);
    }
    const IsotpArrival arrival = receiver_.on_frame(frame, now_us_);
    if (!arrival.datagram) return;
    require(receiver_.size() != 0 && receiver_.size() <= capacity_);
    require(!receiver_.busy());
  }

  // After poll(), the deadline is in the future, or the end has a frame to send.
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
  bool controlled_ = false;    // the sender waits for flow control
  bool listens_only_ = false;  // the receiver sends no flow control
  std::uint32_t capacity_;
  std::vector<std::uint8_t> buffer_;
  std::vector<std::uint8_t> datagram_;
  IsotpSender sender_;
  IsotpReceiver receiver_;
  std::uint32_t now_us_ = 0;

  std::uint8_t number_ = 0;        // number and bytes of the newest datagram
  std::uint32_t size_ = 0;         // size of the newest datagram
  bool any_foreign_ = false;       // a frame from neither end was received
  std::uint32_t accepted_ = 0;     // frames of the datagram on the bus so far
  std::uint32_t accepted_us_ = 0;  // time of the newest accepted frame
  std::uint32_t gap_us_ = 0;       // STmin of the newest flow control
  std::uint8_t heard_number_ = 0;  // number of the newest first or single frame received
  int next_ = 0;                   // sequence number of the next frame
  bool in_order_ = false;          // since that first frame, the frames have counted up from 1
  bool flow_control_late_ = false;
};

}  // namespace
}  // namespace r4

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  r4::Input input(data, size);
  r4::Fuzz(input).run();
  return 0;
}
