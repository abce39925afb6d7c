// SPDX-License-Identifier: GPL-3.0-or-later
// A simulated I2C bus at 400 kHz: chip models behind the drivers' interface, the time that each
// transfer takes, a log of all of them, and errors on request.
//
// Time passes by transfers and by advance(); nobody waits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "../../../drivers/i2c_bus.hpp"
#include "i2c_chip_model.hpp"

namespace r4::sim {

// What happened on the bus.
struct I2cTransfer {
  enum class Kind : std::uint8_t { write, write_read, recover };
  Kind kind = Kind::write;
  std::uint8_t address = 0;
  std::vector<std::uint8_t> written;  // bytes that were acknowledged
  std::vector<std::uint8_t> read;
  firmware::I2cResult result = firmware::I2cResult::ok;
  std::uint64_t start_ns = 0;
  std::uint64_t duration_ns = 0;
  std::size_t bytes = 0;  // on the wire, addresses and refused bytes included
};

class I2cBusModel final : public firmware::I2cBus {
 public:
  static constexpr std::uint64_t clock_ns = 2500;  // 400 kHz

  // The chip must outlive the bus. It is powered on.
  void attach(I2cChipModel& chip);

  firmware::I2cResult write(std::uint8_t address, const std::uint8_t* bytes,
                            std::size_t size) override;
  firmware::I2cResult write_read(std::uint8_t address, const std::uint8_t* out,
                                 std::size_t out_size, std::uint8_t* in,
                                 std::size_t in_size) override;
  bool recover() override;

  std::uint64_t now_us() const { return now_ns_ / 1000; }
  void advance(std::uint64_t us);

  const std::vector<I2cTransfer>& log() const { return log_; }
  void clear_log() { log_.clear(); }

  // Errors. Transfers to `address` are not acknowledged after `after_bytes` bytes of data (0: the
  // address itself), `times` times.
  void refuse(std::uint8_t address, std::size_t after_bytes = 0, int times = 1);
  // A chip holds SDA: transfers time out, until recover() was called `recoveries` times.
  void hold(int recoveries = 1);
  // The bus is held from the moment on at which `after_bytes` more bytes were sent.
  void hold_after(std::size_t after_bytes, int recoveries = 1);
  // `chip` loses power for a moment when `after_bytes` more bytes were sent on the bus.
  void reset_after(I2cChipModel& chip, std::size_t after_bytes);
  void clear_errors();

 private:
  struct Refusal {
    std::uint8_t address;
    std::size_t after_bytes;
    int times;
  };
  struct Reset {
    I2cChipModel* chip;
    std::size_t after_bytes;
  };

  I2cTransfer& begin(I2cTransfer::Kind kind, std::uint8_t address);
  firmware::I2cResult end(I2cTransfer& transfer, firmware::I2cResult result);
  firmware::I2cResult start(I2cTransfer& transfer, std::uint8_t address, bool read);
  firmware::I2cResult send(I2cTransfer& transfer, const std::uint8_t* bytes, std::size_t size);
  void clocks(I2cTransfer& transfer, int count);
  void byte_sent(I2cTransfer& transfer);
  void tell_time();

  std::vector<I2cChipModel*> chips_;
  std::vector<I2cChipModel*> taking_part_;
  std::vector<I2cTransfer> log_;
  std::vector<Refusal> refusals_;
  std::vector<Reset> resets_;
  std::optional<std::size_t> hold_after_;
  int hold_recoveries_ = 0;
  int held_ = 0;  // that many recover() calls are needed
  std::uint64_t now_ns_ = 0;
};

}  // namespace r4::sim
