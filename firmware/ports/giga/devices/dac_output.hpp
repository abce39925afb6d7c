// SPDX-License-Identifier: GPL-3.0-or-later
// A channel of DAC1 (RM0399, chapter DAC). Unbuffered, because the buffer does not reach 0 V.
#pragma once

#include <cstdint>

#include "../../../drivers/pins.hpp"
#include "../chip/chip.hpp"
#include "../chip/gpio.hpp"
#include "../chip/interrupt_lock.hpp"

namespace r4 {
namespace giga {

// Sets both channels to 0 V before they reach their pins.
inline void start_dac(const Pin (&pins)[2]) {
  constexpr std::uint32_t rcc_dac_on = 1U << 29;
  constexpr std::uint32_t no_buffer = 2U | 2U << 16;  // channels 1 and 2, connected to the pin
  constexpr std::uint32_t on = 1U | 1U << 16;
  {
    const InterruptLock lock;
    RCC->APB1LENR |= rcc_dac_on;
    static_cast<void>(static_cast<std::uint32_t>(RCC->APB1LENR));
  }
  DAC1->CR = 0;
  DAC1->MCR = no_buffer;
  DAC1->DHR12R1 = 0;
  DAC1->DHR12R2 = 0;
  DAC1->CR = on;
  for (const Pin pin : pins) {
    make_input(line_of(pin), LinePull::none);
    set_mode(line_of(pin), LineMode::analog);
  }
}

class DacOutput final : public firmware::AnalogOutputPin {
 public:
  explicit DacOutput(int channel) : second_(channel == 2) {}
  // One access, safe in any interrupt and fault handler.
  void write(std::uint16_t millivolts) override {
    constexpr std::uint32_t full_scale = 4095;
    constexpr std::uint32_t reference_mv = 3300;
    const std::uint32_t code = (millivolts * full_scale + reference_mv / 2) / reference_mv;
    (second_ ? DAC1->DHR12R2 : DAC1->DHR12R1) = code;
  }

 private:
  const bool second_;
};

}  // namespace giga
}  // namespace r4
