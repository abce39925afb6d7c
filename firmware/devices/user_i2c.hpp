// SPDX-License-Identifier: GPL-3.0-or-later
// The user's I2C bus, separate from the board's chips (docs/how-to/devices.md). No call waits.
//            begins a transfer              it has ended
//     idle --------------------> transfer ----------------> idle
//      ^                            | lost, or not ended after transfer_limit_ms
//      |  both lines are high       v
//      +----------------------- recovering    up to nine clocks while SDA is low, and a STOP,
//                                   |          half a clock each millisecond (UM10204 3.1.16)
//      |                            | a line is low
//      |       free_after_ms        v
//      +- - - - - - - - - - - -   held        every request fails at once
//
// Single transfers go before readings, and readings before the next address of a scan. Due readings
// take turns. A reading whose previous transfer is under way is skipped. Times are ms, and wrap.
#pragma once

#include <cstdint>

#include "../../protocol/messages/device_command.hpp"
#include "r4link/vocabulary.hpp"
#include "user_i2c_port.hpp"

namespace r4 {
namespace firmware {

class UserI2c {
 public:
  explicit UserI2c(UserI2cPort& port) : port_(port) {}

  // Begins a valid X:READ, X:WRITE or X:SCAN. False if the previous command has not ended.
  bool ask(std::uint32_t pnum, const Command& command);
  // Slots are numbered from 1. If `poll` is off, the slot ends. Discards the slot's last reading.
  void poll_slot(int slot, const I2cPoll& poll, std::uint32_t now_ms);
  // The board is safe: cancels a write that has not begun, because it may move something.
  void drop_write();
  // A session begins: cancels requests and answers of the previous session.
  void drop_all();

  void poll(std::uint32_t now_ms);

  const I2cReading (&readings() const)[i2c_slots] { return readings_; }
  const I2cReading& reading(int slot) const { return readings_[slot - 1]; }
  const I2cAnswer& answer() const { return answer_; }
  const I2cBusReport& report() const { return report_; }
  // True if a single transfer or a scan has ended since the last call.
  bool take_answered() {
    const bool answered = answered_;
    answered_ = false;
    return answered;
  }

  // Longer than a transfer of 32 bytes each way at 100 kHz, and than the longest clock stretch that
  // SMBus allows (25 ms).
  static constexpr std::uint32_t transfer_limit_ms = 35;
  static constexpr std::uint32_t free_after_ms = 100;  // time until a held bus is clocked again

 private:
  enum class Stage : std::uint8_t { idle, transfer, recovering, held };
  enum class Single : std::uint8_t { none, transfer, scan };
  struct Slot {
    I2cPoll poll;
    std::uint32_t due_ms = 0;
  };
  static constexpr int no_slot = -1;               // a single transfer
  static constexpr std::uint8_t half_clocks = 21;  // nine clocks, and STOP

  void begin_next(std::uint32_t now_ms);
  void begin_single(std::uint32_t now_ms);
  bool begin_due(std::uint32_t now_ms);
  void begin(int slot, std::uint8_t address, const std::uint8_t* out, std::uint8_t out_size,
             std::uint8_t in_size, std::uint32_t now_ms);
  void end(I2cOutcome outcome);
  void end_scan_step(I2cOutcome outcome);
  void end_reading(int slot, I2cOutcome outcome);
  void answer(I2cOutcome outcome);
  void count(I2cOutcome outcome);
  void recover(std::uint32_t now_ms);
  void recover_step(std::uint32_t now_ms);
  void fail_what_is_due(std::uint32_t now_ms);
  static void next_time(Slot& slot, std::uint32_t now_ms);

  UserI2cPort& port_;
  Stage stage_ = Stage::idle;
  int slot_ = no_slot;
  std::uint8_t first_slot_ = 0;  // the first slot to check next time
  bool abandoned_ = false;       // the result of the transfer is not needed
  std::uint8_t half_clock_ = 0;
  std::uint32_t since_ms_ = 0;  // start of the stage; recovering: last half clock
  // Buffers of the transfer under way, independent of new requests.
  std::uint8_t sent_[i2c_max_bytes];
  std::uint8_t received_[i2c_max_bytes];

  Single single_ = Single::none;
  bool single_begun_ = false;
  bool writes_ = false;
  std::uint8_t address_ = 0;
  std::uint8_t out_size_ = 0;
  std::uint8_t in_size_ = 0;
  std::uint8_t out_[i2c_max_bytes];
  std::uint32_t pnum_ = 0;
  bool answered_ = false;
  I2cAnswer answer_;
  DeviceBytes<i2c_max_bytes> found_;
  I2cBusReport report_;
  Slot slots_[i2c_slots];
  I2cReading readings_[i2c_slots];
};

}  // namespace firmware
}  // namespace r4
