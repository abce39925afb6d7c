// SPDX-License-Identifier: GPL-3.0-or-later
#include "chip_driver.hpp"

namespace r4 {
namespace firmware {

void ChipDriver::begin() {
  started_ = true;
  ready_ = false;
  trouble_ = ChipTrouble::none;
  want_safe();
  on_begin();
}

void ChipDriver::poll(std::uint32_t now_us, BusBudget& budget) {
  if (!started_) return;
  while (usable() && !ready_) {
    if (!set_up(now_us, budget)) return;
  }
  write_changes(budget);
}

void ChipDriver::write_changes(BusBudget& budget) {
  if (usable() && ready_) on_write_changes(budget);
}

void ChipDriver::verify(BusBudget& budget) {
  if (usable() && ready_) on_verify(budget);
}

bool ChipDriver::note(I2cResult result) {
  if (result == I2cResult::no_acknowledge) fail(ChipTrouble::no_acknowledge);
  if (result == I2cResult::timeout) fail(ChipTrouble::bus_stuck);
  return result == I2cResult::ok;
}

bool ChipDriver::send(const std::uint8_t* bytes, std::size_t size, BusBudget& budget) {
  return usable() && budget.take(size + 1) && note(bus_.write(address_, bytes, size));
}

bool ChipDriver::fetch(std::uint8_t first_register, std::uint8_t* bytes, std::size_t size,
                       BusBudget& budget) {
  return usable() && budget.take(size + 3) &&
         note(bus_.write_read(address_, &first_register, 1, bytes, size));
}

void ChipDriver::fail(ChipTrouble trouble) {
  if (usable()) trouble_ = trouble;
  ready_ = false;
}

}  // namespace firmware
}  // namespace r4
