// SPDX-License-Identifier: GPL-3.0-or-later
// The transfers on a simulated bus, as text. "40 <- 00 31 04" is a write. "40 <- 00 -> 21 04" reads
// a register. " NACK" marks a refused transfer. " TIMEOUT" marks a transfer on a held bus or a
// transfer that was cut short. "recover" means nine clocks.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "firmware/drivers/chip_driver.hpp"
#include "firmware/ports/sim/chips/i2c_bus_model.hpp"

namespace r4::test {

// All transfers since the last clear(). The log must outlive all uses of the bus.
class BusLog final : public sim::I2cObserver {
 public:
  // A transfer that owns its bytes.
  struct Transfer : sim::I2cTransfer {
    explicit Transfer(const sim::I2cTransfer& told)
        : I2cTransfer(told),
          written(told.written, told.written + told.written_size),
          read(told.read, told.read + told.read_size) {}
    std::vector<std::uint8_t> written;
    std::vector<std::uint8_t> read;
  };

  explicit BusLog(sim::I2cBusModel& bus) { bus.set_observer(this); }
  BusLog(const BusLog&) = delete;
  BusLog& operator=(const BusLog&) = delete;

  void on_transfer(const sim::I2cTransfer& transfer) override { transfers_.emplace_back(transfer); }
  const std::vector<Transfer>& transfers() const { return transfers_; }
  void clear() { transfers_.clear(); }

 private:
  std::vector<Transfer> transfers_;
};

std::string to_text(const BusLog::Transfer& transfer);
std::vector<std::string> lines(const BusLog& log);
std::vector<std::string> writes(const BusLog& log);

struct BusCost {
  std::size_t bytes = 0;
  double us = 0;
};
BusCost cost(const BusLog& log);

// Calls poll(now_us) each millisecond for `ms` milliseconds of the bus's time.
template <class Driver>
void run(Driver& driver, sim::I2cBusModel& bus, int ms, std::size_t budget_bytes = 48) {
  for (int i = 0; i < ms; ++i) {
    firmware::BusBudget budget(budget_bytes);
    driver.poll(static_cast<std::uint32_t>(bus.now_us()), budget);
    bus.advance(1000);
  }
}

}  // namespace r4::test
