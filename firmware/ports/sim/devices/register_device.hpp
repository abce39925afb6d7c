// SPDX-License-Identifier: GPL-3.0-or-later
// A device with one-byte registers. A write's first byte sets the pointer; later bytes move it.
#pragma once

#include <cstdint>

#include "../chips/i2c_chip_model.hpp"

namespace r4 {
namespace sim {

class RegisterDevice : public I2cChipModel {
 public:
  bool start(std::uint8_t address, bool read) final {
    if (address != address_) return false;
    wants_pointer_ = !read;
    if (read) latch();
    return true;
  }
  bool write(std::uint8_t byte) final {
    if (wants_pointer_) {
      pointer_ = byte;
      wants_pointer_ = false;
    } else {
      write_register(pointer_, byte);
      pointer_ = after(pointer_);
    }
    return true;
  }
  std::uint8_t read() final {
    const std::uint8_t byte = read_register(pointer_);
    pointer_ = after(pointer_);
    return byte;
  }

 protected:
  explicit RegisterDevice(std::uint8_t address) : address_(address) {}
  ~RegisterDevice() = default;
  virtual std::uint8_t read_register(std::uint8_t at) = 0;
  virtual void write_register(std::uint8_t at, std::uint8_t byte) = 0;
  // Called when a read begins, because the bytes of a burst belong together.
  virtual void latch() {}
  virtual std::uint8_t after(std::uint8_t at) const { return static_cast<std::uint8_t>(at + 1); }
  void set_pointer(std::uint8_t at) { pointer_ = at; }

 private:
  std::uint8_t address_;
  std::uint8_t pointer_ = 0;
  bool wants_pointer_ = false;
};

}  // namespace sim
}  // namespace r4
