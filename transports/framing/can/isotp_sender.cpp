// SPDX-License-Identifier: GPL-3.0-or-later
#include "isotp_sender.hpp"

#include <cstring>

namespace r4 {
namespace {

IsotpSenderOptions possible(IsotpSenderOptions options) {
  const bool longer = options.channel.fd && options.tx_dl > max_classic_size;
  options.tx_dl = longer ? can_frame_size(options.tx_dl) : max_classic_size;
  return options;
}

}  // namespace

IsotpSender::IsotpSender(const IsotpSenderOptions& options) : options_(possible(options)) {}

bool IsotpSender::begin(const void* data, std::uint32_t size, std::uint32_t now_us) {
  if (busy() || size == 0) return false;
  data_ = static_cast<const std::uint8_t*>(data);
  size_ = size;
  sent_ = 0;
  sequence_ = 1;
  any_consecutive_ = false;
  block_left_ = 0;
  waits_ = 0;
  gap_us_ = options_.separation_us;
  state_ = State::ready;
  deadline_us_ = now_us;
  error_ = IsotpError::none;
  ++counters_.started;
  return true;
}

bool IsotpSender::offer(std::uint32_t now_us, CanFrame& frame) {
  if (state_ == State::ready && reached(now_us, deadline_us_)) {
    state_ = State::offered;
    deadline_us_ = now_us + options_.n_as_us;
  } else if (state_ != State::offered || poll(now_us) != IsotpError::none) {
    return false;
  }
  std::uint32_t used = 0;
  if (sent_ == 0) {
    used = write_start(frame);
  } else {
    frame.data[0] = isotp_frame::control(IsotpFrameType::consecutive, sequence_);
    const std::uint32_t left = size_ - sent_;
    const std::uint32_t room = options_.tx_dl - 1U;
    chunk_ = static_cast<std::uint8_t>(left < room ? left : room);
    if (chunk_ == max_classic_size - 1) {  // usual case: a copy of known size needs no call
      std::memcpy(frame.data + 1, data_ + sent_, max_classic_size - 1);
    } else {
      std::memcpy(frame.data + 1, data_ + sent_, chunk_);
    }
    used = chunk_ + 1U;
  }
  isotp_frame::finish(frame, options_.channel, options_.channel.id, used);
  return true;
}

std::uint32_t IsotpSender::write_start(CanFrame& frame) {
  std::uint32_t header = 0;
  if (size_ < max_classic_size) {
    frame.data[header++] = isotp_frame::control(IsotpFrameType::single, size_);
  } else if (options_.tx_dl > max_classic_size && size_ <= options_.tx_dl - 2U) {
    frame.data[header++] = isotp_frame::control(IsotpFrameType::single, 0);
    frame.data[header++] = static_cast<std::uint8_t>(size_);
  } else if (size_ <= max_short_first_frame) {
    frame.data[header++] = isotp_frame::control(IsotpFrameType::first, size_ >> 8);
    frame.data[header++] = static_cast<std::uint8_t>(size_);
  } else {
    frame.data[header++] = isotp_frame::control(IsotpFrameType::first, 0);
    frame.data[header++] = 0;
    for (int shift = 24; shift >= 0; shift -= 8) {
      frame.data[header++] = static_cast<std::uint8_t>(size_ >> shift);
    }
  }
  const std::uint32_t room = options_.tx_dl - header;
  chunk_ = static_cast<std::uint8_t>(size_ < room ? size_ : room);
  std::memcpy(frame.data + header, data_, chunk_);
  return header + chunk_;
}

void IsotpSender::frame_sent(std::uint32_t now_us) {
  if (state_ != State::offered) return;
  const bool was_first = sent_ == 0;
  ++counters_.frames;
  sent_ += chunk_;
  if (sent_ == size_) {
    ++counters_.datagrams;
    state_ = State::idle;
    return;
  }
  bool block_ends = was_first;
  if (!was_first) {
    any_consecutive_ = true;
    sequence_ = (sequence_ + 1) & 0xF;
    block_ends = block_left_ != 0 && --block_left_ == 0;
  }
  sent_us_ = now_us;
  if (block_ends && options_.flow_control) {
    state_ = State::waiting;
    deadline_us_ = now_us + options_.n_bs_us;
  } else {
    state_ = State::ready;
    deadline_us_ = now_us + gap_us_;
  }
}

void IsotpSender::wait_anew(std::uint32_t now_us) {
  sent_us_ = now_us;
  if (state_ == State::waiting) {
    deadline_us_ = now_us + options_.n_bs_us;
  } else if (state_ == State::ready && any_consecutive_) {
    deadline_us_ = now_us + gap_us_;
  }
}

IsotpError IsotpSender::on_frame(const CanFrame& frame, std::uint32_t now_us) {
  if (!isotp_frame::is_for(frame, options_.channel.flow_control_id)) return IsotpError::none;
  if (!isotp_frame::is_flow_control(frame)) {
    return IsotpError::none;
  }
  const IsotpError late = poll(now_us);
  const IsotpError error = on_flow_control(frame, now_us);
  return late != IsotpError::none ? late : error;
}

IsotpError IsotpSender::on_flow_control(const CanFrame& frame, std::uint32_t now_us) {
  if (frame.size < 3 || !has_valid_size(frame)) {
    ++counters_.malformed;
    return IsotpError::malformed;
  }
  if (state_ != State::waiting) {
    ++counters_.unexpected_frame;
    return IsotpError::unexpected_frame;
  }
  switch (static_cast<IsotpFlowStatus>(frame.data[0] & 0xF)) {
    case IsotpFlowStatus::clear_to_send: {
      const std::uint32_t wanted_us = stmin_to_us(frame.data[2]);
      gap_us_ = wanted_us > options_.separation_us ? wanted_us : options_.separation_us;
      block_left_ = frame.data[1];
      waits_ = 0;
      state_ = State::ready;
      // The gap also holds between two blocks, from the acceptance of a frame if that is later.
      const std::uint32_t due_us = sent_us_ + gap_us_;
      deadline_us_ = any_consecutive_ && !reached(now_us, due_us) ? due_us : now_us;
      return IsotpError::none;
    }
    case IsotpFlowStatus::wait:
      if (waits_ == options_.max_waits) {
        return fail(IsotpError::too_many_waits, counters_.too_many_waits);
      }
      ++waits_;
      deadline_us_ = now_us + options_.n_bs_us;
      return IsotpError::none;
    case IsotpFlowStatus::overflow:
      return fail(IsotpError::overflow, counters_.overflow);
  }
  return fail(IsotpError::invalid_flow_status, counters_.invalid_flow_status);
}

IsotpError IsotpSender::time_out() {
  return state_ == State::offered
             ? fail(IsotpError::send_timeout, counters_.send_timeout)
             : fail(IsotpError::flow_control_timeout, counters_.flow_control_timeout);
}

void IsotpSender::cancel() {
  if (busy()) fail(IsotpError::cancelled, counters_.cancelled);
}

IsotpError IsotpSender::fail(IsotpError error, std::uint32_t& counter) {
  ++counter;
  state_ = State::idle;
  error_ = error;
  return error;
}

}  // namespace r4
