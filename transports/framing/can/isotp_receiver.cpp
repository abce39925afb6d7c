// SPDX-License-Identifier: GPL-3.0-or-later
#include "isotp_receiver.hpp"

#include <cstring>

namespace r4 {
namespace {

// The shortest datagram that needs a first frame of that size (9.6.3.1, table 14).
constexpr std::uint32_t min_segmented(std::uint8_t rx_dl) {
  return rx_dl == max_classic_size ? max_classic_size : rx_dl - 1U;
}

}  // namespace

IsotpReceiver::IsotpReceiver(const IsotpReceiverOptions& options, void* buffer,
                             std::uint32_t capacity)
    : options_(options), buffer_(static_cast<std::uint8_t*>(buffer)), capacity_(capacity) {}

IsotpArrival IsotpReceiver::on_frame(const CanFrame& frame, std::uint32_t now_us) {
  if (!isotp_frame::is_for(frame, options_.channel.id)) return {false, IsotpError::none};
  const IsotpError late = poll(now_us);
  IsotpArrival arrival{};
  if (frame.size == 0 || !has_valid_size(frame)) {
    arrival = malformed();
  } else {
    switch (static_cast<IsotpFrameType>(frame.data[0] >> 4)) {
      case IsotpFrameType::consecutive:
        arrival = on_consecutive(frame, now_us);
        break;
      case IsotpFrameType::single:
        arrival = on_single(frame);
        break;
      case IsotpFrameType::first:
        arrival = on_first(frame, now_us);
        break;
      case IsotpFrameType::flow_control:
        return {false, late};
      default:
        arrival = malformed();
    }
  }
  ++counters_.frames;
  if (late != IsotpError::none) arrival.error = late;
  return arrival;
}

// Accepts an escaped length that fits in four bits, because it is unambiguous.
IsotpArrival IsotpReceiver::on_single(const CanFrame& frame) {
  const bool escaped = frame.size > max_classic_size;
  const std::uint32_t header = escaped ? 2 : 1;
  const std::uint32_t low = frame.data[0] & 0xF;
  const std::uint32_t size = escaped ? frame.data[1] : low;
  if (size == 0 || size > frame.size - header || (escaped && low != 0)) return malformed();
  const IsotpError error = replace();
  if (size > capacity_) return {false, refuse(error)};
  ++counters_.started;
  ++counters_.datagrams;
  size_ = size;
  std::memcpy(buffer_, frame.data + header, size);
  return {true, error};
}

IsotpArrival IsotpReceiver::on_first(const CanFrame& frame, std::uint32_t now_us) {
  if (frame.size < max_classic_size) return malformed();
  std::uint32_t header = 2;
  std::uint32_t size = (frame.data[0] & 0xFU) << 8 | frame.data[1];
  if (size == 0) {
    while (header < 6) size = size << 8 | frame.data[header++];
    if (size <= max_short_first_frame) return malformed();
  }
  if (size < min_segmented(frame.size)) return malformed();
  const IsotpError error = replace();
  if (size > capacity_) {
    if (!options_.listen_only) owe(IsotpFlowStatus::overflow, now_us);
    return {false, refuse(error)};
  }
  ++counters_.started;
  size_ = size;
  rx_dl_ = frame.size;
  received_ = frame.size - header;
  std::memcpy(buffer_, frame.data + header, received_);
  sequence_ = 1;
  block_left_ = 0;
  waits_ = 0;
  if (options_.listen_only) {
    state_ = State::receiving;
    deadline_us_ = now_us + options_.n_cr_us;
  } else {
    owe(IsotpFlowStatus::clear_to_send, now_us);
  }
  return {false, error};
}

IsotpArrival IsotpReceiver::on_consecutive(const CanFrame& frame, std::uint32_t now_us) {
  if (state_ != State::receiving) {
    ++counters_.unexpected_frame;
    return {false, IsotpError::unexpected_frame};
  }
  const std::uint32_t left = size_ - received_;
  const std::uint32_t room = rx_dl_ - 1U;
  const std::uint32_t chunk = left < room ? left : room;
  const bool follows = (frame.data[0] & 0xF) == sequence_;
  // Only the last frame may be shorter than the first frame (9.6.4.1).
  if (frame.size > rx_dl_ || frame.size <= chunk || !follows) {
    // A wrong number proves a loss. If ignored, a frame of the next transfer could fill the gap.
    if (follows) return malformed();
    return {false, fail(IsotpError::wrong_sequence_number, counters_.wrong_sequence_number)};
  }
  if (chunk == max_classic_size - 1) {  // usual case: a copy of known size needs no call
    std::memcpy(buffer_ + received_, frame.data + 1, max_classic_size - 1);
  } else {
    std::memcpy(buffer_ + received_, frame.data + 1, chunk);
  }
  ++counters_.consecutive;
  received_ += chunk;
  sequence_ = (sequence_ + 1) & 0xF;
  deadline_us_ = now_us + options_.n_cr_us;
  if (received_ == size_) {
    ++counters_.datagrams;
    state_ = State::idle;
    return {true, IsotpError::none};
  }
  if (block_left_ != 0 && --block_left_ == 0) owe(IsotpFlowStatus::clear_to_send, now_us);
  return {false, IsotpError::none};
}

bool IsotpReceiver::offer(std::uint32_t now_us, CanFrame& frame) {
  if (state_ == State::receiving) return false;
  poll(now_us);
  if (state_ == State::owing && reached(now_us, deadline_us_)) {
    if (!refusing()) status_ = held_ ? IsotpFlowStatus::wait : IsotpFlowStatus::clear_to_send;
    state_ = State::offered;
    deadline_us_ = now_us + options_.n_ar_us;
  }
  if (state_ != State::offered) return false;
  frame.data[0] =
      isotp_frame::control(IsotpFrameType::flow_control, static_cast<std::uint32_t>(status_));
  frame.data[1] = options_.block_size;
  frame.data[2] = options_.stmin;
  isotp_frame::finish(frame, options_.channel, options_.channel.flow_control_id, 3);
  return true;
}

void IsotpReceiver::frame_sent(std::uint32_t now_us) {
  if (state_ != State::offered) return;
  switch (status_) {
    case IsotpFlowStatus::clear_to_send:
      waits_ = 0;
      block_left_ = options_.block_size;
      state_ = State::receiving;
      deadline_us_ = now_us + options_.n_cr_us;
      break;
    case IsotpFlowStatus::wait:
      ++waits_;
      owe(IsotpFlowStatus::wait, held_ ? now_us + options_.wait_gap_us : now_us);
      break;
    case IsotpFlowStatus::overflow:
      rest();
      break;
  }
}

void IsotpReceiver::hold(bool held, std::uint32_t now_us) {
  if (held_ && !held && state_ == State::owing) deadline_us_ = now_us;
  held_ = held;
}

void IsotpReceiver::owe(IsotpFlowStatus status, std::uint32_t now_us) {
  status_ = status;
  state_ = State::owing;
  deadline_us_ = now_us;
}

IsotpArrival IsotpReceiver::malformed() {
  ++counters_.malformed;
  return {false, IsotpError::malformed};
}

IsotpError IsotpReceiver::replace() {
  const IsotpError error =
      busy() ? fail(IsotpError::interrupted, counters_.interrupted) : IsotpError::none;
  rest();
  return error;
}

// A datagram is too long; `error` is the earlier error.
IsotpError IsotpReceiver::refuse(IsotpError error) {
  ++counters_.overflow;
  return error != IsotpError::none ? error : IsotpError::overflow;
}

IsotpError IsotpReceiver::time_out() {
  switch (state_) {
    case State::owing:
      if (refusing() || !held_ || waits_ < options_.max_waits) break;
      return fail(IsotpError::too_many_waits, counters_.too_many_waits);
    case State::offered:
      if (!refusing()) return fail(IsotpError::send_timeout, counters_.send_timeout);
      return fail(IsotpError::send_timeout, counters_.refusal_timeout);
    case State::receiving:
      return fail(IsotpError::consecutive_timeout, counters_.consecutive_timeout);
    case State::idle:
      break;
  }
  return IsotpError::none;
}

void IsotpReceiver::cancel() {
  if (busy()) fail(IsotpError::cancelled, counters_.cancelled);
  rest();
}

IsotpError IsotpReceiver::fail(IsotpError error, std::uint32_t& counter) {
  ++counter;
  rest();
  return error;
}

void IsotpReceiver::rest() {
  state_ = State::idle;
  status_ = IsotpFlowStatus::clear_to_send;
}

}  // namespace r4
