// SPDX-License-Identifier: GPL-3.0-or-later
// What went over a simulated bus, as people write it in data sheets: "40 <- 00 31 04" for a write,
// "40 <- 00 -> 21 04" for a read of a register; refused ones end with " NACK", those of a held bus
// with " TIMEOUT"; "recover" for nine clocks.
#pragma once

#include <string>
#include <vector>

#include "firmware/drivers/chip_driver.hpp"
#include "firmware/ports/sim/chips/i2c_bus_model.hpp"

namespace r4::test {

std::string to_text(const sim::I2cTransfer& transfer);
std::vector<std::string> lines(const sim::I2cBusModel& bus);
// Only those that write to a chip (not reads).
std::vector<std::string> writes(const sim::I2cBusModel& bus);

struct BusCost {
  std::size_t bytes = 0;
  double us = 0;
};
BusCost cost(const sim::I2cBusModel& bus);

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
