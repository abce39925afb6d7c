// SPDX-License-Identifier: GPL-3.0-or-later
// The user's I2C bus of the simulated board: a controller at 100 kHz, the devices, and their
// faults. A transfer takes as long as on the wire, and reads the values of its beginning.
#pragma once

#include <cstdint>

#include "../../../devices/user_i2c_port.hpp"
#include "../chips/i2c_chip_model.hpp"

namespace r4 {
namespace sim {

class UserBusModel final : public firmware::UserI2cPort {
 public:
  static constexpr int max_devices = 8;
  static constexpr std::uint64_t clock_ns = 10000;  // 100 kHz

  enum class Fault : std::uint8_t {
    none,
    held,       // a device holds SDA low
    cut_off,    // a device cut off in mid-byte holds SDA low until it has received nine clocks
    stretched,  // a device holds SCL low
  };

  // The device must outlive the bus. False if there are max_devices already.
  bool attach(I2cChipModel& device);
  void connect(const I2cChipModel& device, bool connected);
  void set_fault(Fault fault);
  Fault fault() const { return fault_; }
  void advance(std::uint64_t us) { now_ns_ += us * 1000; }
  void reset();
  std::uint32_t transfers() const { return transfers_; }  // begun so far; wraps

  void begin(const firmware::UserTransfer& transfer) override;
  Progress progress() override;
  void release() override;
  void drive(bool scl, bool sda) override;
  bool scl_is_high() override;
  bool sda_is_high() override;
  void resume() override;

 private:
  bool is_free() { return scl_is_high() && sda_is_high(); }
  bool send(const firmware::UserTransfer& transfer);
  bool address(std::uint8_t to, bool read);

  I2cChipModel* devices_[max_devices] = {};
  int device_count_ = 0;
  unsigned disconnected_ = 0;  // bit: device
  unsigned addressed_ = 0;
  Fault fault_ = Fault::none;
  int clocks_left_ = 0;  // until a device that was cut off releases SDA
  bool scl_ = true;
  bool sda_ = true;
  std::uint64_t now_ns_ = 0;
  std::uint64_t ends_ns_ = 0;
  std::uint32_t transfers_ = 0;
  int clocks_ = 0;
  bool waits_ = false;  // waits for lines that are not free
  Progress result_ = Progress::done;
};

}  // namespace sim
}  // namespace r4
