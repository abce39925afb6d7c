// SPDX-License-Identifier: GPL-3.0-or-later
#include "machine.hpp"

#include "chip/board_clock.hpp"

namespace r4 {
namespace giga {

namespace {

firmware::BoardHardware::Config config_of(const Wiring& wiring, ChipTrouble trouble) {
  firmware::BoardHardware::Config config;
  config.wiring = wiring;
  config.wiring_trouble = trouble;
  static_assert(firmware::BoardHardware::step_tick_hz == step_tick_hz, "the rate of the timer");
  return config;
}

UserUartController::Parts parts_of_uart(int channel) {
  UserUartController::Parts parts;
  parts.registers = channel == 1 ? USART2 : UART4;
  parts.tx = uart_tx_pins[channel - 1];
  parts.rx = uart_rx_pins[channel - 1];
  parts.function = uart_functions[channel - 1];
  return parts;
}

void start_uarts(UserUartController& first, UserUartController& second) {
  constexpr std::uint32_t rcc_usart2_and_uart4_on = 1U << 17 | 1U << 19;
  {
    const InterruptLock lock;
    RCC->APB1LENR |= rcc_usart2_and_uart4_on;
    static_cast<void>(static_cast<std::uint32_t>(RCC->APB1LENR));
  }
  // Default clock of both UARTs (RCC_D2CCIP2R).
  first.start(HAL_RCC_GetPCLK1Freq());
  second.start(HAL_RCC_GetPCLK1Freq());
}

GpioOutput output(const Wiring& wiring, SignalKind kind, int channel) {
  return GpioOutput(line_of(wiring.at(kind, channel)));
}

GpioInput spare_input(const Wiring& wiring, int channel) {
  return GpioInput(line_of(wiring.at(SignalKind::gpio, channel)), LinePull::up);
}

// A broken wire reads as released.
GpioInput handle_input(Place place) {
  return GpioInput(line_of(place), place.option() ? LinePull::up : LinePull::down);
}

}  // namespace

void Machine::Encoder::connect(const Wiring& wiring, int channel) {
  const Place index_place = wiring.at(SignalKind::encoder_index, channel);
  const Place a_place = wiring.at(SignalKind::encoder_a, channel);
  const Place b_place = wiring.at(SignalKind::encoder_b, channel);
  index = line_of(index_place);
  make_input(index, LinePull::down);
  a = line_of(a_place);
  b = line_of(b_place);
  if (!a_place.connected()) return;  // the wiring has both lines or none
  a_edge.make(pin_name(pin_of(a_place)), PullUp);
  b_edge.make(pin_name(pin_of(b_place)), PullUp);
}

void Machine::Encoder::start(firmware::QuadratureEncoder& with) {
  counter = &with;
  if (!a_edge.made()) return;
  on_edge();
  for (mbed::InterruptIn* edge : {&*a_edge, &*b_edge}) {
    edge->rise(mbed::callback(this, &Encoder::on_edge));
    edge->fall(mbed::callback(this, &Encoder::on_edge));
  }
}

// The core calls non-const methods. NOLINTBEGIN(readability-make-member-function-const)
void Machine::Encoder::on_edge() { counter->sample(read(a), read(b)); }
void Machine::Echo::on_edge() { sensors->echo(sensor, read(line), BoardClock::now_us()); }
// NOLINTEND(readability-make-member-function-const)

void Machine::Echo::connect(Place place) {
  line = line_of(place);
  if (place.connected()) edge.make(pin_name(pin_of(place)), PullDown);
}

void Machine::Echo::start(firmware::UltrasonicSensors& with, int number) {
  sensors = &with;
  sensor = number;
  if (!edge.made()) return;
  edge->rise(mbed::callback(this, &Echo::on_edge));
  edge->fall(mbed::callback(this, &Echo::on_edge));
}

Machine::OutputsOff::OutputsOff(firmware::BoardHardware& hardware) {
  hardware.power_up(BoardClock::now_us());
}

Machine::Machine(const Wiring& wiring, ChipTrouble wiring_trouble, Buses& buses)
    : choice_(firmware::choose_bus(wiring, buses.answers(), wiring_trouble)),
      bus_(buses[choice_.chips]),
      step_{output(wiring, SignalKind::step, 1), output(wiring, SignalKind::step, 2),
            output(wiring, SignalKind::step, 3), output(wiring, SignalKind::step, 4)},
      direction_{output(wiring, SignalKind::step_direction, 1),
                 output(wiring, SignalKind::step_direction, 2),
                 output(wiring, SignalKind::step_direction, 3),
                 output(wiring, SignalKind::step_direction, 4)},
      trigger_{output(wiring, SignalKind::trigger, 1), output(wiring, SignalKind::trigger, 2),
               output(wiring, SignalKind::trigger, 3), output(wiring, SignalKind::trigger, 4)},
      handle_(handle_input(wiring.at(SignalKind::handle))),
      gpio_{spare_input(wiring, 1), spare_input(wiring, 2), spare_input(wiring, 3),
            spare_input(wiring, 4), spare_input(wiring, 5), spare_input(wiring, 6),
            spare_input(wiring, 7), spare_input(wiring, 8)},
      dac_{DacOutput(1), DacOutput(2)},
      hardware_(bus_, pins(), config_of(wiring, choice_.wiring_trouble)),
      outputs_off_(hardware_),
      analog_(analog_values_, wiring),
      user_bus_(parts_of_bus(1 - choice_.chips)),
      user_i2c_(user_bus_),
      uart1_(parts_of_uart(1)),
      uart2_(parts_of_uart(2)),
      uarts_{firmware::UserUart(uart1_), firmware::UserUart(uart2_)} {
  for (int i = 0; i < encoder_channels; ++i) encoders_[i].connect(wiring, i + 1);
  for (int i = 0; i < ultrasonic_channels; ++i) {
    echoes_[i].connect(wiring.at(SignalKind::echo, i + 1));
  }
  // Before the application starts, because readings that are settings need the bus and the UARTs.
  user_bus_.start(start_bus_clock(1 - choice_.chips));
  start_uarts(uart1_, uart2_);
}

firmware::BoardPins Machine::pins() {
  firmware::BoardPins pins{};
  for (int i = 0; i < stepper_channels; ++i) {
    pins.step[i] = &step_[i];
    pins.direction[i] = &direction_[i];
  }
  for (int i = 0; i < ultrasonic_channels; ++i) pins.trigger[i] = &trigger_[i];
  for (int i = 0; i < analog_channels; ++i) pins.analog[i] = &analog_values_[i];
  pins.handle = &handle_;
  for (int i = 0; i < dac_channels; ++i) pins.dac[i] = &dac_[i];
  for (int i = 0; i < gpio_channels; ++i) pins.gpio[i] = &gpio_[i];
  return pins;
}

void Machine::add_devices(firmware::Application::Config& config) {
  if (choice_.user_may) config.i2c = &user_i2c_;
  for (int i = 0; i < uart_channels; ++i) config.uarts[i] = &uarts_[i];
}

void Machine::start(firmware::Guard& guard) {
  guard_ = &guard;
  step_duty_ = guard.add_duty(step_limit_ms);
  for (int i = 0; i < encoder_channels; ++i) encoders_[i].start(hardware_.encoder(i + 1));
  for (int i = 0; i < ultrasonic_channels; ++i) echoes_[i].start(hardware_.ultrasonic(), i);
  start_step_timer(*this);
}

void Machine::poll() {
  analog_.poll();
  hardware_.poll(BoardClock::now_us());
}

void Machine::step_tick() {
  guard_->check_in(step_duty_);
  hardware_.step_tick();
  user_bus_.tick();
  const bool sends = !guard_->tripped();
  uart1_.tick(sends);
  uart2_.tick(sends);
  for (int i = 0; i < encoder_channels; ++i) {
    hardware_.encoder(i + 1).index(read(encoders_[i].index));
  }
}

}  // namespace giga
}  // namespace r4
