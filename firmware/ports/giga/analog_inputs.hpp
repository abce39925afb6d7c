// SPDX-License-Identifier: GPL-3.0-or-later
// Converts the connected analog inputs in turn, one per poll; unconnected inputs read 0. Call from
// the loop only. The core sets up pins and converter. Then this class uses the registers of ADC1
// (RM0399, chapter ADC), and never waits. The core would wait up to 10 ms for a conversion. If the
// converter did not switch on, the core would end the boot.
#pragma once

#include <cstdint>

#include "chip/chip.hpp"
#include "late.hpp"
#include "pins.hpp"

namespace r4 {
namespace giga {

constexpr PinName pin_name(Pin pin) {
  return static_cast<PinName>((pin.port - 'A') << 4 | pin.number);
}
static_assert(pin_name({'A', 0}) == PA_0 && pin_name({'C', 5}) == PC_5 &&
                  pin_name({'K', 7}) == PK_7,
              "the core numbers its pins otherwise");

class AnalogValue final : public firmware::AnalogPin {
 public:
  std::uint16_t read() override { return newest; }
  std::uint16_t newest = 0;
};

class AnalogInputs {
 public:
  // Construct before any interrupt with a deadline is enabled.
  AnalogInputs(AnalogValue (&values)[analog_channels], const Wiring& wiring) : values_(values) {
    for (int i = 0; i < analog_channels; ++i) {
      const Place place = wiring.at(SignalKind::analog, i + 1);
      if (!place.connected()) continue;
      values_[i].newest = converters_[i].make(pin_name(pin_of(place))).read_u16();
      set_up(inputs_[i] = adc1_inputs[place.number() - first_analog_pin]);
      any_ = true;
    }
  }

  // If the converter stops, all inputs read 0: an old voltage would look like a measured voltage.
  void poll() {
    if (!any_) return;
    if (convert()) {
      late_ = 0;
    } else if (++late_ >= patience) {
      late_ = 0;
      for (AnalogValue& value : values_) value.newest = 0;
    }
  }

 private:
  static void set_up(std::uint32_t input) {
    ADC1->PCSEL |= 1U << input;
    auto& times = input < 10 ? ADC1->SMPR1 : ADC1->SMPR2;
    const std::uint32_t shift = 3 * (input % 10);
    times = (times & ~(7U << shift)) | sampling_time << shift;
  }

  bool convert() {
    const std::uint32_t control = ADC1->CR;
    if ((control & cr_on) == 0) {  // the core switches the converter off after a reading
      ADC1->ISR = isr_ready;
      command(cr_on);
      step_ = Step::switching_on;
      return false;
    }
    const std::uint32_t status = ADC1->ISR;
    const bool busy =
        (control & cr_convert) != 0 || (step_ == Step::switching_on && (status & isr_ready) == 0);
    if (busy) return false;
    const bool converted = step_ == Step::converting && (status & isr_converted) != 0;
    if (converted) {
      values_[next_].newest = static_cast<std::uint16_t>(ADC1->DR);
      next_ = (next_ + 1) % analog_channels;
    }
    while (!converters_[next_].made()) next_ = (next_ + 1) % analog_channels;
    ADC1->SQR1 = inputs_[next_] << 6;
    command(cr_convert);
    step_ = Step::converting;
    return converted;
  }

  enum class Step : std::uint8_t { idle, switching_on, converting };

  static constexpr std::uint32_t cr_on = 1U << 0;           // ADEN
  static constexpr std::uint32_t cr_convert = 1U << 2;      // ADSTART
  static constexpr std::uint32_t cr_commands = 0x8000003F;  // bits that act when a 1 is written
  static constexpr std::uint32_t isr_ready = 1U << 0;       // ADRDY
  static constexpr std::uint32_t isr_converted = 1U << 2;   // EOC
  static constexpr std::uint32_t sampling_time = 5;         // 64.5 clocks, as the core sets
  static constexpr int patience = 10;                       // polls; a conversion takes 2 us

  static void command(std::uint32_t bit_to_set) {
    ADC1->CR = (ADC1->CR & ~cr_commands) | bit_to_set;
  }

  AnalogValue (&values_)[analog_channels];
  Late<mbed::AnalogIn> converters_[analog_channels];
  std::uint32_t inputs_[analog_channels] = {};  // inputs of ADC1
  bool any_ = false;                            // an input is connected
  int next_ = 0;
  int late_ = 0;
  Step step_ = Step::idle;
};

}  // namespace giga
}  // namespace r4
