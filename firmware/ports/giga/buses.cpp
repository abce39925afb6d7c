// SPDX-License-Identifier: GPL-3.0-or-later
#include "buses.hpp"

#include "../../drivers/pca9685.hpp"
#include "chip/board_clock.hpp"
#include "chip/interrupt_lock.hpp"
#include "devices/dac_output.hpp"
#include "pins.hpp"

namespace r4 {
namespace giga {

namespace {

bool switch_outputs_off(firmware::I2cBus& bus) {
  std::uint8_t mode = 0;
  const firmware::I2cResult answer =
      bus.write_read(firmware::Pca9685::all_call_address, nullptr, 0, &mode, 1);
  if (answer != firmware::I2cResult::ok) return false;
  (void)firmware::Pca9685::reset_all(bus);
  (void)firmware::Pca9685::all_off(bus);
  return true;
}

}  // namespace

I2cController::Parts parts_of_bus(int bus) {
  I2cController::Parts parts;
  parts.registers = bus == 0 ? I2C2 : I2C4;
  parts.scl = i2c_scl_pins[bus];
  parts.sda = i2c_sda_pins[bus];
  parts.scl_function = i2c_scl_functions[bus];
  parts.sda_function = i2c_sda_functions[bus];
  return parts;
}

std::uint32_t start_bus_clock(int bus) {
  constexpr std::uint32_t rcc_i2c2_on = 1U << 22;
  constexpr std::uint32_t rcc_i2c4_on = 1U << 7;
  const InterruptLock lock;
  if (bus == 0) {
    RCC->APB1LENR |= rcc_i2c2_on;
    static_cast<void>(static_cast<std::uint32_t>(RCC->APB1LENR));
    return HAL_RCC_GetPCLK1Freq();  // default clock of I2C1-3 (RCC_D2CCIP2R)
  }
  RCC->APB4ENR |= rcc_i2c4_on;
  static_cast<void>(static_cast<std::uint32_t>(RCC->APB4ENR));
  return HAL_RCCEx_GetD3PCLK1Freq();  // default clock of I2C4 (RCC_D3CCIPR)
}

Buses::PortsOn::PortsOn() {
  start_ports();
  start_dac(dac_pins);
}

Buses::Buses()
    : first_(parts_of_bus(0), &BoardClock::now_us), second_(parts_of_bus(1), &BoardClock::now_us) {
  for (int i = 0; i < bus_count; ++i) {
    (*this)[i].start(start_bus_clock(i));
    if (switch_outputs_off((*this)[i])) answers_ |= 1U << i;
  }
}

}  // namespace giga
}  // namespace r4
