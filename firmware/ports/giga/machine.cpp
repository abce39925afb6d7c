// SPDX-License-Identifier: GPL-3.0-or-later
#include "machine.hpp"

#include "chip/board_clock.hpp"

namespace r4 {
namespace giga {

namespace {

firmware::BoardHardware::Config hardware_config() {
  firmware::BoardHardware::Config config;
  // A missing sensor is blind: with a threshold it counts as an obstacle.
  config.ultrasonic_fitted = (1U << ultrasonic_channels) - 1;
  config.step_tick_hz = static_cast<std::int32_t>(step_tick_hz);
  return config;
}

I2cController::Wiring bus_wiring() {
  I2cController::Wiring wiring;
  wiring.registers = I2C2;
  wiring.scl = i2c_scl_pin;
  wiring.sda = i2c_sda_pin;
  wiring.scl_function = i2c_function;
  wiring.sda_function = i2c_function;
  return wiring;
}

I2cController::Wiring user_wiring() {
  I2cController::Wiring wiring;
  wiring.registers = I2C4;
  wiring.scl = user_scl_pin;
  wiring.sda = user_sda_pin;
  wiring.scl_function = user_scl_function;
  wiring.sda_function = user_sda_function;
  return wiring;
}

void start_user_bus(UserI2cController& bus) {
  constexpr std::uint32_t rcc_i2c4_on = 1U << 7;
  {
    const InterruptLock lock;
    RCC->APB4ENR |= rcc_i2c4_on;
    static_cast<void>(static_cast<std::uint32_t>(RCC->APB4ENR));
  }
  bus.start(HAL_RCCEx_GetD3PCLK1Freq());  // default clock of I2C4 (RCC_D3CCIPR)
}

UserUartController::Wiring uart_wiring(int channel) {
  UserUartController::Wiring wiring;
  wiring.registers = channel == 1 ? USART2 : UART4;
  wiring.tx = uart_tx_pins[channel - 1];
  wiring.rx = uart_rx_pins[channel - 1];
  wiring.function = uart_functions[channel - 1];
  return wiring;
}

void start_uarts(UserUartController& first, UserUartController& second) {
  constexpr std::uint32_t rcc_usart2_and_uart4_on = 1U << 17 | 1U << 19;
  {
    const InterruptLock lock;
    RCC->APB1LENR |= rcc_usart2_and_uart4_on;
    static_cast<void>(static_cast<std::uint32_t>(RCC->APB1LENR));
  }
  // Default clock of both (RCC_D2CCIP2R).
  first.start(HAL_RCC_GetPCLK1Freq());
  second.start(HAL_RCC_GetPCLK1Freq());
}

GpioInput spare_input(int channel) {
  return GpioInput(line_of(gpio_pins[channel - 1]), LinePull::up);
}

void start_bus(I2cController& bus) {
  constexpr std::uint32_t rcc_i2c2_on = 1U << 22;
  {
    const InterruptLock lock;
    RCC->APB1LENR |= rcc_i2c2_on;
    static_cast<void>(static_cast<std::uint32_t>(RCC->APB1LENR));
  }
  bus.start(HAL_RCC_GetPCLK1Freq());  // default clock of I2C1-3 (RCC_D2CCIP2R)
}

}  // namespace

Machine::Encoder::Encoder(Pin a_pin, Pin b_pin, Pin index_pin)
    : a(line_of(a_pin)),
      b(line_of(b_pin)),
      index(line_of(index_pin), LinePull::down),
      a_edge(pin_name(a_pin), PullUp),
      b_edge(pin_name(b_pin), PullUp) {}

// The core calls non-const methods. NOLINTBEGIN(readability-make-member-function-const)
void Machine::Encoder::on_edge() { counter->sample(read(a), read(b)); }

Machine::Echo::Echo(Pin pin) : line(line_of(pin)), edge(pin_name(pin), PullDown) {}

void Machine::Echo::on_edge() { sensors->echo(sensor, read(line), BoardClock::now_us()); }
// NOLINTEND(readability-make-member-function-const)

Machine::OutputsOff::OutputsOff(I2cController& bus, firmware::BoardHardware& hardware) {
  start_bus(bus);
  hardware.power_up(BoardClock::now_us());
}

Machine::Machine()
    : bus_(bus_wiring(), &BoardClock::now_us),
      step_{GpioOutput(line_of(step_pins[0])), GpioOutput(line_of(step_pins[1])),
            GpioOutput(line_of(step_pins[2])), GpioOutput(line_of(step_pins[3]))},
      direction_{GpioOutput(line_of(direction_pins[0])), GpioOutput(line_of(direction_pins[1])),
                 GpioOutput(line_of(direction_pins[2])), GpioOutput(line_of(direction_pins[3]))},
      trigger_{GpioOutput(line_of(trigger_pins[0])), GpioOutput(line_of(trigger_pins[1])),
               GpioOutput(line_of(trigger_pins[2])), GpioOutput(line_of(trigger_pins[3]))},
      handle_(line_of(handle_pin), LinePull::down),
      gpio_{spare_input(1), spare_input(2), spare_input(3), spare_input(4),
            spare_input(5), spare_input(6), spare_input(7), spare_input(8)},
      dac_{DacOutput(1), DacOutput(2)},
      hardware_(bus_, pins(), hardware_config()),
      outputs_off_(bus_, hardware_),
      analog_(analog_values_),
      user_bus_(user_wiring()),
      user_i2c_(user_bus_),
      uart1_(uart_wiring(1)),
      uart2_(uart_wiring(2)),
      uarts_{firmware::UserUart(uart1_), firmware::UserUart(uart2_)},
      encoder1_(encoder_a_pins[0], encoder_b_pins[0], index_pins[0]),
      encoder2_(encoder_a_pins[1], encoder_b_pins[1], index_pins[1]),
      encoder3_(encoder_a_pins[2], encoder_b_pins[2], index_pins[2]),
      encoder4_(encoder_a_pins[3], encoder_b_pins[3], index_pins[3]),
      echo1_(echo_pins[0]),
      echo2_(echo_pins[1]),
      echo3_(echo_pins[2]),
      echo4_(echo_pins[3]) {
  // Before the application starts: readings that are kept as settings need both.
  start_user_bus(user_bus_);
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
  config.i2c = &user_i2c_;
  for (int i = 0; i < uart_channels; ++i) config.uarts[i] = &uarts_[i];
}

void Machine::start(firmware::Guard& guard) {
  guard_ = &guard;
  step_duty_ = guard.add_duty(step_limit_ms);
  for (int i = 0; i < encoder_channels; ++i) {
    Encoder& encoder = *encoders_[i];
    encoder.counter = &hardware_.encoder(i + 1);
    encoder.on_edge();
    for (mbed::InterruptIn* line : {&encoder.a_edge, &encoder.b_edge}) {
      line->rise(mbed::callback(&encoder, &Encoder::on_edge));
      line->fall(mbed::callback(&encoder, &Encoder::on_edge));
    }
  }
  for (int i = 0; i < ultrasonic_channels; ++i) {
    Echo& echo = *echoes_[i];
    echo.sensors = &hardware_.ultrasonic();
    echo.sensor = i;
    echo.edge.rise(mbed::callback(&echo, &Echo::on_edge));
    echo.edge.fall(mbed::callback(&echo, &Echo::on_edge));
  }
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
    hardware_.encoder(i + 1).index(encoders_[i]->index.read());
  }
}

}  // namespace giga
}  // namespace r4
