// SPDX-License-Identifier: GPL-3.0-or-later
// Base of the I2C chip drivers: set-up without waiting, writes of changes, and register checks.
//           begin()             poll(), over and over
//     new ----------> setting up ----------------------> ready
//                        ^   |                             |  a transfer failed, or verify() found
//                begin() |   | a transfer failed           |  other values than were written
//                        |   v                             v
//                      trouble <---------------------------+
//
// A driver in trouble makes no transfers until begin(). Times are us of a clock that wraps.
#pragma once

#include <cstddef>
#include <cstdint>

#include "i2c_bus.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {
namespace firmware {

using r4::ChipTrouble;

// Bytes that the bus can carry in the rest of this poll, addresses included.
class BusBudget {
 public:
  explicit BusBudget(std::size_t bytes) : left_(bytes) {}
  std::size_t left() const { return left_; }
  bool take(std::size_t bytes) {
    if (bytes > left_) {
      exhausted_ = true;
      return false;
    }
    left_ -= bytes;
    return true;
  }
  bool exhausted() const { return exhausted_; }

 private:
  std::size_t left_;
  bool exhausted_ = false;
};

// The smallest budget of a poll: some steps of a set-up need this many bytes at once.
constexpr std::size_t bus_budget_min = 36;

class ChipDriver {
 public:
  ChipDriver(const ChipDriver&) = delete;
  ChipDriver& operator=(const ChipDriver&) = delete;

  std::uint8_t address() const { return address_; }
  bool ready() const { return ready_; }
  ChipTrouble trouble() const { return trouble_; }

  // Restarts the set-up from any state of the chip, with all outputs off.
  void begin();
  // Does the next steps of the set-up; once ready, writes the registers that change.
  void poll(std::uint32_t now_us, BusBudget& budget);
  // No effect before ready(). verify() compares the chip's registers with the written values.
  void write_changes(BusBudget& budget);
  void verify(BusBudget& budget);
  // All outputs are off from the next write on. Sends nothing.
  virtual void want_safe() = 0;
  // All outputs off at once, in any state. Does not change trouble(): the caller uses note().
  virtual I2cResult make_safe() = 0;
  // Takes the result of a transfer that was made for this driver. True if the transfer succeeded.
  bool note(I2cResult result);

 protected:
  ChipDriver(I2cBus& bus, std::uint8_t address) : bus_(bus), address_(address) {}
  ~ChipDriver() = default;

  virtual void on_begin() = 0;
  // True if another step may follow at once.
  virtual bool set_up(std::uint32_t now_us, BusBudget& budget) = 0;
  virtual void on_write_changes(BusBudget& budget) = 0;
  virtual void on_verify(BusBudget& budget) = 0;

  // False if the budget is too small now, or the transfer failed (then there is trouble).
  bool send(const std::uint8_t* bytes, std::size_t size, BusBudget& budget);
  bool fetch(std::uint8_t first_register, std::uint8_t* bytes, std::size_t size, BusBudget& budget);
  void fail(ChipTrouble trouble);
  void set_ready() { ready_ = true; }
  bool usable() const { return trouble_ == ChipTrouble::none; }

  I2cBus& bus_;

 private:
  std::uint8_t address_;
  bool started_ = false;
  bool ready_ = false;
  ChipTrouble trouble_ = ChipTrouble::none;
};

}  // namespace firmware
}  // namespace r4
