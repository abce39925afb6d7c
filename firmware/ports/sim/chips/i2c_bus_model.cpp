// SPDX-License-Identifier: GPL-3.0-or-later
#include "i2c_bus_model.hpp"

#include <algorithm>

namespace r4::sim {

using firmware::I2cResult;

void I2cBusModel::attach(I2cChipModel& chip) {
  chips_.push_back(&chip);
  chip.set_time(now_us());
  chip.power_on();
}

I2cResult I2cBusModel::write(std::uint8_t address, const std::uint8_t* bytes, std::size_t size) {
  I2cTransfer& transfer = begin(I2cTransfer::Kind::write, address);
  I2cResult result = start(transfer, address, false);
  if (result == I2cResult::ok) result = send(transfer, bytes, size);
  return end(transfer, result);
}

I2cResult I2cBusModel::write_read(std::uint8_t address, const std::uint8_t* out,
                                  std::size_t out_size, std::uint8_t* in, std::size_t in_size) {
  I2cTransfer& transfer = begin(I2cTransfer::Kind::write_read, address);
  I2cResult result = I2cResult::ok;
  if (out_size != 0) {
    result = start(transfer, address, false);
    if (result == I2cResult::ok) result = send(transfer, out, out_size);
  }
  if (result == I2cResult::ok) result = start(transfer, address, true);
  for (std::size_t i = 0; i < in_size && result == I2cResult::ok; ++i) {
    if (held_ != 0) {
      result = I2cResult::timeout;
      break;
    }
    in[i] = taking_part_.empty() ? 0xFF : taking_part_.front()->read();
    transfer.read.push_back(in[i]);
    byte_sent(transfer);
  }
  return end(transfer, result);
}

bool I2cBusModel::recover() {
  I2cTransfer& transfer = begin(I2cTransfer::Kind::recover, 0);
  clocks(transfer, 10);
  if (held_ > 0) --held_;
  end(transfer, held_ == 0 ? I2cResult::ok : I2cResult::timeout);
  return held_ == 0;
}

void I2cBusModel::advance(std::uint64_t us) {
  now_ns_ += us * 1000;
  tell_time();
}

void I2cBusModel::refuse(std::uint8_t address, std::size_t after_bytes, int times) {
  refusals_.push_back({address, after_bytes, times});
}

void I2cBusModel::hold(int recoveries) { held_ = recoveries; }

void I2cBusModel::hold_after(std::size_t after_bytes, int recoveries) {
  hold_after_ = after_bytes;
  hold_recoveries_ = recoveries;
}

void I2cBusModel::reset_after(I2cChipModel& chip, std::size_t after_bytes) {
  resets_.push_back({&chip, after_bytes});
}

void I2cBusModel::clear_errors() {
  refusals_.clear();
  resets_.clear();
  hold_after_.reset();
  held_ = 0;
}

I2cTransfer& I2cBusModel::begin(I2cTransfer::Kind kind, std::uint8_t address) {
  tell_time();
  taking_part_.clear();
  I2cTransfer& transfer = log_.emplace_back();
  transfer.kind = kind;
  transfer.address = address;
  transfer.start_ns = now_ns_;
  return transfer;
}

I2cResult I2cBusModel::end(I2cTransfer& transfer, I2cResult result) {
  clocks(transfer, 1);
  if (result == I2cResult::timeout && transfer.kind != I2cTransfer::Kind::recover) {
    now_ns_ += std::uint64_t{firmware::i2c_timeout_us} * 1000;
  }
  tell_time();
  // A chip that is cut off by a held line sees no STOP.
  if (result != I2cResult::timeout) {
    for (I2cChipModel* chip : taking_part_) chip->stop();
  }
  transfer.result = result;
  transfer.duration_ns = now_ns_ - transfer.start_ns;
  return result;
}

I2cResult I2cBusModel::start(I2cTransfer& transfer, std::uint8_t address, bool read) {
  if (held_ != 0) return I2cResult::timeout;
  clocks(transfer, 1);
  std::vector<I2cChipModel*> answering;
  const auto refusal = std::find_if(refusals_.begin(), refusals_.end(), [&](const Refusal& r) {
    return r.address == address && r.after_bytes == 0 && r.times > 0;
  });
  if (refusal != refusals_.end()) {
    --refusal->times;
  } else {
    for (I2cChipModel* chip : chips_) {
      if (chip->start(address, read)) answering.push_back(chip);
    }
  }
  // A chip that was addressed before a repeated START and is not now sees the STOP nevertheless.
  for (I2cChipModel* chip : answering) {
    std::erase(taking_part_, chip);
  }
  taking_part_.insert(taking_part_.begin(), answering.begin(), answering.end());
  byte_sent(transfer);
  if (answering.empty()) return I2cResult::no_acknowledge;
  return held_ != 0 ? I2cResult::timeout : I2cResult::ok;
}

I2cResult I2cBusModel::send(I2cTransfer& transfer, const std::uint8_t* bytes, std::size_t size) {
  const auto refusal = std::find_if(refusals_.begin(), refusals_.end(), [&](const Refusal& r) {
    return r.address == transfer.address && r.after_bytes != 0 && r.after_bytes < size &&
           r.times > 0;
  });
  std::size_t accepted = size;
  if (refusal != refusals_.end()) {
    --refusal->times;
    accepted = refusal->after_bytes;
  }
  for (std::size_t i = 0; i < size; ++i) {
    bool acknowledged = false;
    if (i < accepted) {
      for (I2cChipModel* chip : taking_part_) acknowledged |= chip->write(bytes[i]);
    }
    byte_sent(transfer);
    if (held_ != 0) return I2cResult::timeout;
    if (!acknowledged) return I2cResult::no_acknowledge;
    transfer.written.push_back(bytes[i]);
  }
  return I2cResult::ok;
}

void I2cBusModel::clocks(I2cTransfer& transfer, int count) {
  static_cast<void>(transfer);
  now_ns_ += static_cast<std::uint64_t>(count) * clock_ns;
}

void I2cBusModel::byte_sent(I2cTransfer& transfer) {
  ++transfer.bytes;
  clocks(transfer, 9);
  tell_time();
  for (Reset& reset : resets_) {
    if (reset.after_bytes > 0 && --reset.after_bytes == 0) {
      reset.chip->power_on();
      std::erase(taking_part_, reset.chip);
    }
  }
  std::erase_if(resets_, [](const Reset& reset) { return reset.after_bytes == 0; });
  if (hold_after_ && --*hold_after_ == 0) {
    hold_after_.reset();
    held_ = hold_recoveries_;
  }
}

void I2cBusModel::tell_time() {
  for (I2cChipModel* chip : chips_) chip->set_time(now_us());
}

}  // namespace r4::sim
