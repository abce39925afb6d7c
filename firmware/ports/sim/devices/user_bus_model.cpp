// SPDX-License-Identifier: GPL-3.0-or-later
#include "user_bus_model.hpp"

namespace r4 {
namespace sim {

bool UserBusModel::attach(I2cChipModel& device) {
  if (device_count_ == max_devices) return false;
  devices_[device_count_++] = &device;
  device.follow(now_ns_);
  device.power_on();
  return true;
}

void UserBusModel::connect(const I2cChipModel& device, bool connected) {
  for (int i = 0; i < device_count_; ++i) {
    if (devices_[i] != &device) continue;
    const unsigned bit = 1U << static_cast<unsigned>(i);
    disconnected_ = connected ? disconnected_ & ~bit : disconnected_ | bit;
  }
}

void UserBusModel::set_fault(Fault fault) {
  constexpr int nine_clocks = 9;
  fault_ = fault;
  clocks_left_ = fault == Fault::cut_off ? nine_clocks : 0;
}

void UserBusModel::reset() {
  scl_ = sda_ = true;
  waits_ = false;
  ends_ns_ = now_ns_;
}

// A device that takes a line during a transfer stops the transfer.
UserBusModel::Progress UserBusModel::progress() {
  if (waits_ || (now_ns_ < ends_ns_ && !is_free())) {
    waits_ = true;
    return Progress::busy;
  }
  return now_ns_ < ends_ns_ ? Progress::busy : result_;
}

void UserBusModel::begin(const firmware::UserTransfer& transfer) {
  ++transfers_;
  clocks_ = 0;
  waits_ = !is_free();  // the controller waits, as for another controller's transfer
  if (waits_) return;
  result_ = send(transfer) ? Progress::done : Progress::refused;
  for (int i = 0; i < device_count_; ++i) {
    if ((addressed_ >> i & 1) != 0) devices_[i]->stop();
  }
  addressed_ = 0;
  ends_ns_ = now_ns_ + static_cast<std::uint64_t>(clocks_ + 1) * clock_ns;
}

bool UserBusModel::address(std::uint8_t to, bool read) {
  clocks_ += 1 + 9;
  addressed_ = 0;
  for (int i = 0; i < device_count_; ++i) {
    if ((disconnected_ >> i & 1) == 0 && devices_[i]->start(to, read)) {
      addressed_ |= 1U << static_cast<unsigned>(i);
    }
  }
  return addressed_ != 0;
}

bool UserBusModel::send(const firmware::UserTransfer& transfer) {
  if (transfer.out_size != 0 || transfer.in_size == 0) {
    if (!address(transfer.address, false)) return false;
    for (std::size_t n = 0; n < transfer.out_size; ++n) {
      clocks_ += 9;
      bool acknowledged = false;
      for (int i = 0; i < device_count_; ++i) {
        if ((addressed_ >> i & 1) != 0 && devices_[i]->write(transfer.out[n])) acknowledged = true;
      }
      if (!acknowledged) return false;
    }
  }
  if (transfer.in_size == 0) return true;
  if (!address(transfer.address, true)) return false;
  for (std::size_t n = 0; n < transfer.in_size; ++n) {
    clocks_ += 9;
    std::uint8_t byte = 0xFF;  // no device pulls SDA low
    for (int i = 0; i < device_count_; ++i) {
      if ((addressed_ >> i & 1) != 0) byte &= devices_[i]->read();
    }
    transfer.in[n] = byte;
  }
  return true;
}

void UserBusModel::release() {
  waits_ = false;
  ends_ns_ = now_ns_;
  scl_ = sda_ = true;
}

void UserBusModel::drive(bool scl, bool sda) {
  if (scl && !scl_ && fault_ == Fault::cut_off && --clocks_left_ <= 0) fault_ = Fault::none;
  scl_ = scl;
  sda_ = sda;
}

bool UserBusModel::scl_is_high() { return scl_ && fault_ != Fault::stretched; }
bool UserBusModel::sda_is_high() {
  return sda_ && fault_ != Fault::held && fault_ != Fault::cut_off;
}
void UserBusModel::resume() { scl_ = sda_ = true; }

}  // namespace sim
}  // namespace r4
