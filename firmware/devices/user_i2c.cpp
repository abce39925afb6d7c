// SPDX-License-Identifier: GPL-3.0-or-later
#include "user_i2c.hpp"

#include <cstring>

#include "../../protocol/datagram/wrapping.hpp"

namespace r4 {
namespace firmware {

bool UserI2c::ask(std::uint32_t pnum, const Command& command) {
  if (single_ != Single::none) return false;
  single_ = command.kind == CommandKind::i2c_scan ? Single::scan : Single::transfer;
  single_begun_ = false;
  writes_ = command.kind == CommandKind::i2c_write;
  pnum_ = pnum;
  address_ = i2c_first_address;
  out_size_ = in_size_ = 0;
  found_.size = 0;
  if (single_ == Single::transfer) {
    address_ = static_cast<std::uint8_t>(command.value);
    parse_bytes(command.text, out_, sizeof out_, out_size_);
    in_size_ = command.count;
  }
  return true;
}

void UserI2c::poll_slot(int slot, const I2cPoll& poll, std::uint32_t now_ms) {
  if (slot_ == slot - 1) abandoned_ = true;
  Slot& place = slots_[slot - 1];
  place = Slot();
  readings_[slot - 1] = I2cReading();
  place.poll = poll;
  place.due_ms = now_ms;
}

void UserI2c::drop_write() {
  if (single_ == Single::transfer && writes_ && !single_begun_) answer(I2cOutcome::cancelled);
}

void UserI2c::drop_all() {
  const bool under_way = single_ != Single::none && single_begun_ && slot_ == no_slot;
  if (under_way && stage_ == Stage::transfer) abandoned_ = true;
  single_ = Single::none;
  answer_ = I2cAnswer();
  answered_ = false;
}

void UserI2c::poll(std::uint32_t now_ms) {
  if (stage_ == Stage::transfer) {
    switch (port_.progress()) {
      case UserI2cPort::Progress::done:
        end(I2cOutcome::done);
        break;
      case UserI2cPort::Progress::refused:
        end(I2cOutcome::no_acknowledge);
        break;
      case UserI2cPort::Progress::lost:
        end(I2cOutcome::bus_stuck);
        recover(now_ms);
        break;
      case UserI2cPort::Progress::busy:
        if (now_ms - since_ms_ < transfer_limit_ms) return;
        port_.release();  // before another transfer uses the buffer
        end(I2cOutcome::bus_stuck);
        recover(now_ms);
        break;
    }
  }
  if (stage_ == Stage::recovering && now_ms != since_ms_) recover_step(now_ms);
  if (stage_ == Stage::held) {
    fail_what_is_due(now_ms);
    if (now_ms - since_ms_ >= free_after_ms) recover(now_ms);
  }
  if (stage_ == Stage::idle) begin_next(now_ms);
}

void UserI2c::begin_next(std::uint32_t now_ms) {
  if (single_ == Single::transfer) return begin_single(now_ms);
  if (!begin_due(now_ms) && single_ == Single::scan) begin_single(now_ms);
}

void UserI2c::begin_single(std::uint32_t now_ms) {
  single_begun_ = true;
  begin(no_slot, address_, out_, out_size_, in_size_, now_ms);
}

bool UserI2c::begin_due(std::uint32_t now_ms) {
  for (int i = 0; i < i2c_slots; ++i) {
    const int at = (first_slot_ + i) % i2c_slots;
    Slot& slot = slots_[at];
    if (!slot.poll.on() || !reached(now_ms, slot.due_ms)) continue;
    next_time(slot, now_ms);
    first_slot_ = static_cast<std::uint8_t>((at + 1) % i2c_slots);
    const I2cPoll& poll = slot.poll;
    begin(at, poll.address, poll.register_bytes, poll.register_size, poll.count, now_ms);
    return true;
  }
  return false;
}

// The slot stays on the grid of its period. Periods that have passed are skipped.
void UserI2c::next_time(Slot& slot, std::uint32_t now_ms) {
  const std::uint32_t period = slot.poll.period_ms;
  slot.due_ms += (1 + (now_ms - slot.due_ms) / period) * period;
}

void UserI2c::begin(int slot, std::uint8_t address, const std::uint8_t* out, std::uint8_t out_size,
                    std::uint8_t in_size, std::uint32_t now_ms) {
  std::memcpy(sent_, out, out_size);
  UserTransfer transfer;
  transfer.address = address;
  transfer.out = sent_;
  transfer.out_size = out_size;
  transfer.in = received_;
  transfer.in_size = in_size;
  stage_ = Stage::transfer;
  since_ms_ = now_ms;
  slot_ = slot;
  abandoned_ = false;
  port_.begin(transfer);
}

void UserI2c::end(I2cOutcome outcome) {
  const int slot = slot_;
  stage_ = Stage::idle;
  slot_ = no_slot;
  const bool scans = slot == no_slot && single_ == Single::scan;
  if (!scans || outcome == I2cOutcome::bus_stuck) count(outcome);
  if (abandoned_) return;
  if (slot != no_slot) {
    end_reading(slot, outcome);
  } else if (scans) {
    end_scan_step(outcome);
  } else {
    if (outcome == I2cOutcome::done) {
      answer_.data.size = in_size_;
      std::memcpy(answer_.data.bytes, received_, in_size_);
    }
    answer(outcome);
  }
}

void UserI2c::end_reading(int slot, I2cOutcome outcome) {
  I2cReading& reading = readings_[slot];
  if (outcome != I2cOutcome::done) {
    ++reading.errors;
    return;
  }
  reading.t_ms = since_ms_;
  reading.data.size = slots_[slot].poll.count;
  std::memcpy(reading.data.bytes, received_, reading.data.size);
}

void UserI2c::end_scan_step(I2cOutcome outcome) {
  if (outcome == I2cOutcome::bus_stuck) return answer(outcome);
  if (outcome == I2cOutcome::done) found_.bytes[found_.size++] = address_;
  if (address_ != i2c_last_address && found_.size != i2c_max_bytes) {
    ++address_;
    return;
  }
  answer_.data = found_;
  answer(I2cOutcome::done);
}

void UserI2c::answer(I2cOutcome outcome) {
  single_ = Single::none;
  answer_.pnum = pnum_;
  answer_.outcome = outcome;
  if (outcome != I2cOutcome::done) answer_.data.size = 0;
  answered_ = true;
}

void UserI2c::count(I2cOutcome outcome) {
  report_.newest = outcome;
  if (outcome != I2cOutcome::done) ++report_.errors;
}

void UserI2c::recover(std::uint32_t now_ms) {
  port_.release();
  ++report_.recoveries;
  stage_ = Stage::recovering;
  half_clock_ = 0;
  since_ms_ = now_ms;
}

void UserI2c::recover_step(std::uint32_t now_ms) {
  since_ms_ = now_ms;
  // If SDA is high, send STOP: a device that is being written to would take more clocks for bits.
  const bool may_stop = half_clock_ % 2 == 0 && half_clock_ < half_clocks - 3;
  if (may_stop && port_.sda_is_high()) half_clock_ = half_clocks - 3;
  if (half_clock_ < half_clocks - 3) {
    port_.drive(half_clock_ % 2 != 0, true);
  } else if (half_clock_ < half_clocks) {
    // STOP: SDA rises while SCL is high.
    const int left = half_clocks - half_clock_;
    port_.drive(left <= 2, left <= 1);
  }
  if (half_clock_++ < half_clocks) return;
  if (port_.scl_is_high() && port_.sda_is_high()) {
    port_.resume();
    stage_ = Stage::idle;
  } else {
    stage_ = Stage::held;
  }
}

void UserI2c::fail_what_is_due(std::uint32_t now_ms) {
  if (single_ != Single::none) {
    count(I2cOutcome::bus_stuck);
    answer(I2cOutcome::bus_stuck);
  }
  for (int i = 0; i < i2c_slots; ++i) {
    Slot& slot = slots_[i];
    if (!slot.poll.on() || !reached(now_ms, slot.due_ms)) continue;
    next_time(slot, now_ms);
    ++readings_[i].errors;
    count(I2cOutcome::bus_stuck);
  }
}

}  // namespace firmware
}  // namespace r4
