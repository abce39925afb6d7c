// SPDX-License-Identifier: GPL-3.0-or-later
// A simulated I2C bus at 400 kHz: chip models with the drivers' interface, and errors on request.
// Transfers and advance() let simulated time pass. Only an I2cProcessor really waits, and keeps
// each byte whole, as the wire does. An interrupt may make transfers during a transfer. The
// interrupted transfer then ends with `timeout` and does not change the chips.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../../../drivers/i2c_bus.hpp"
#include "i2c_chip_model.hpp"

namespace r4 {
namespace sim {

// The bytes belong to the caller and the chips: valid during on_transfer() only.
struct I2cTransfer {
  enum class Kind : std::uint8_t { write, write_read, recover };
  Kind kind = Kind::write;
  std::uint8_t address = 0;
  firmware::I2cResult result = firmware::I2cResult::ok;
  const std::uint8_t* written = nullptr;
  std::size_t written_size = 0;  // bytes that were acknowledged
  const std::uint8_t* read = nullptr;
  std::size_t read_size = 0;
  std::uint64_t start_ns = 0;
  std::uint64_t duration_ns = 0;
  std::size_t bytes = 0;  // on the wire, addresses and refused bytes included
};

class I2cObserver {
 public:
  // A transfer has ended. An interrupted transfer is reported after the interrupt's transfer.
  virtual void on_transfer(const I2cTransfer& transfer) = 0;

 protected:
  ~I2cObserver() = default;
};

class I2cProcessor {
 public:
  virtual std::uint32_t hold_interrupts() = 0;
  virtual void release_interrupts(std::uint32_t before) = 0;
  // The wire was busy for `ns`; interrupts may occur.
  virtual void wait(std::uint32_t ns) = 0;

 protected:
  ~I2cProcessor() = default;
};

class I2cBusModel final : public firmware::I2cBus {
 public:
  static constexpr std::uint64_t clock_ns = 2500;  // 400 kHz
  static constexpr int max_chips = 8;
  static constexpr int max_errors = 8;  // most pending errors of each kind

  // Powers the chip on. The chip must outlive the bus. False if there are max_chips already.
  bool attach(I2cChipModel& chip);
  void connect(const I2cChipModel& chip, bool connected);
  void set_observer(I2cObserver* observer) { observer_ = observer; }
  void set_processor(I2cProcessor* processor) { processor_ = processor; }

  firmware::I2cResult write(std::uint8_t address, const std::uint8_t* bytes,
                            std::size_t size) override;
  firmware::I2cResult write_read(std::uint8_t address, const std::uint8_t* out,
                                 std::size_t out_size, std::uint8_t* in,
                                 std::size_t in_size) override;
  bool recover() override;

  std::uint64_t now_ns() const;
  std::uint64_t now_us() const { return now_ns() / 1000; }
  void advance(std::uint64_t us);
  std::uint32_t transfers() const { return transfers_; }

  // `after_bytes`: accepted bytes of data; 0: the address itself. False if max_errors are pending.
  bool refuse(std::uint8_t address, std::size_t after_bytes = 0, int times = 1);
  // A chip holds SDA: transfers time out until `recoveries` calls of recover().
  void hold(int recoveries = 1);
  void hold_after(std::size_t after_bytes, int recoveries = 1);
  // `chip` loses power for a moment after `after_bytes` more bytes on the bus.
  bool reset_after(I2cChipModel& chip, std::size_t after_bytes);
  void clear_errors();

 private:
  using ChipSet = std::uint8_t;  // bit: chip
  static_assert(max_chips <= 8, "a ChipSet has eight bits");

  struct Refusal {
    std::uint8_t address = 0;
    std::size_t after_bytes = 0;
    int times = 0;  // 0: unused
  };
  struct Reset {
    I2cChipModel* chip = nullptr;
    std::size_t after_bytes = 0;  // 0: unused
  };
  struct Transfer : I2cTransfer {
    std::uint32_t number = 0;
  };
  class Held;

  void begin(Transfer& transfer, I2cTransfer::Kind kind, std::uint8_t address);
  firmware::I2cResult end(Transfer& transfer, firmware::I2cResult result);
  firmware::I2cResult start(Transfer& transfer, bool read);
  firmware::I2cResult send(Transfer& transfer, const std::uint8_t* bytes, std::size_t size);
  firmware::I2cResult send_byte(Transfer& transfer, std::uint8_t byte, bool refused);
  firmware::I2cResult fetch_byte(Transfer& transfer, std::uint8_t& byte);
  bool cut_short(const Transfer& transfer) const { return transfer.number != transfers_; }
  Refusal* refusal_of(std::uint8_t address, std::size_t first, std::size_t last);
  void stop_chips();
  void byte_sent(Transfer& transfer);
  void pass(int clocks) { now_ns_ += static_cast<std::uint64_t>(clocks) * clock_ns; }

  I2cChipModel* chips_[max_chips] = {};
  int chip_count_ = 0;
  ChipSet disconnected_ = 0;
  ChipSet addressed_ = 0;    // chips addressed by the last START
  ChipSet taking_part_ = 0;  // chips that took part since the last STOP
  Refusal refusals_[max_errors];
  Reset resets_[max_errors];
  std::size_t hold_after_ = 0;  // 0: never
  int hold_recoveries_ = 0;
  int held_ = 0;  // remaining calls of recover()
  std::uint64_t now_ns_ = 0;
  volatile std::uint32_t transfers_ = 0;
  I2cObserver* observer_ = nullptr;
  I2cProcessor* processor_ = nullptr;
};

}  // namespace sim
}  // namespace r4
