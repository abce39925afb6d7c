// SPDX-License-Identifier: GPL-3.0-or-later
// A board with CAN, UART and all chips, to link for `tools/m7 --size`: QEMU has no such machine.
#include "../../../transports/framing/can/can_node.hpp"
#include "../../application/application.hpp"
#include "../../board_hardware.hpp"
#include "chip/board_clock.hpp"
#include "chip/registers.hpp"
#include "fault.hpp"
#include "links/uart.hpp"
#include "r4link/config.hpp"
#include "startup.hpp"

namespace {

using namespace r4;
using namespace r4::m7;

constexpr std::uint32_t watchdog_ms = 500;
Uart link(uart0_base);
firmware::Guard* watching = nullptr;
BoardClock* watch = nullptr;

struct Controller {
  volatile bool has_received = false;
  CanFrame received;
  CanFrame sent;
};
Controller controller;

class CanPort final : public firmware::Port {
 public:
  explicit CanPort(BoardClock& clock) : clock_(clock) {}
  template <class OnDatagram>
  void receive(OnDatagram&& on_datagram) {
    if (controller.has_received) {
      controller.has_received = false;
      const Text datagram = node_.on_frame(controller.received, clock_.now_us());
      if (!datagram.empty()) on_datagram(datagram);
    }
    node_.poll(clock_.now_us());
    while (node_.offer(clock_.now_us(), controller.sent)) node_.frame_sent(clock_.now_us());
  }
  void send(Text datagram, Priority, std::uint32_t) override {
    node_.begin(datagram, clock_.now_us());
  }
  std::size_t max_size() const override { return max_datagram; }
  void use_packed_form(bool wanted) override { node_.use_packed_form(wanted); }
  bool is_bus() const override { return true; }

 private:
  BoardClock& clock_;
  CanNode node_{CanEnd::board, 1, false};
};

class Bus final : public firmware::I2cBus {
 public:
  firmware::I2cResult write(std::uint8_t address, const std::uint8_t* bytes,
                            std::size_t size) override {
    for (std::size_t i = 0; i < size; ++i)
      wire_ = static_cast<std::uint32_t>(address << 8 | bytes[i]);
    return firmware::I2cResult::ok;
  }
  firmware::I2cResult write_read(std::uint8_t address, const std::uint8_t* out,
                                 std::size_t out_size, std::uint8_t* in,
                                 std::size_t in_size) override {
    write(address, out, out_size);
    for (std::size_t i = 0; i < in_size; ++i) in[i] = static_cast<std::uint8_t>(wire_);
    return firmware::I2cResult::ok;
  }
  bool recover() override { return true; }

 private:
  volatile std::uint32_t wire_ = 0;
};

class UserBus final : public firmware::UserI2cPort {
 public:
  void begin(const firmware::UserTransfer& transfer) override { wire_ = transfer.address; }
  Progress progress() override { return Progress::done; }
  void release() override { drive(true, true); }
  void drive(bool scl, bool sda) override { wire_ = scl && sda ? 1 : 0; }
  bool scl_is_high() override { return wire_ != 0; }
  bool sda_is_high() override { return wire_ != 0; }
  void resume() override {}

 private:
  volatile std::uint32_t wire_ = 1;
};

class UserUartPlace final : public firmware::UserUartPort {
 public:
  void set_up(const UartMode& mode) override { wire_ = mode.baud; }
  std::size_t receive(std::uint8_t* out, std::size_t) override {
    *out = static_cast<std::uint8_t>(wire_);
    return wire_ & 1;
  }
  std::uint32_t take_lost() override { return wire_; }
  bool send(const std::uint8_t* bytes, std::size_t) override {
    wire_ = *bytes;
    return true;
  }
  void drop() override { wire_ = 0; }

 private:
  volatile std::uint32_t wire_ = 0;
};

class Output final : public firmware::OutputPin {
 public:
  void write(bool high) override { level_ = high; }

 private:
  volatile bool level_ = false;
};
class Input final : public firmware::InputPin {
 public:
  bool read() override { return level_; }

 private:
  volatile bool level_ = true;
};
class AnalogOutput final : public firmware::AnalogOutputPin {
 public:
  void write(std::uint16_t millivolts) override { millivolts_ = millivolts; }

 private:
  volatile std::uint16_t millivolts_ = 0;
};
class Converter final : public firmware::AnalogPin {
 public:
  std::uint16_t read() override { return value_; }

 private:
  volatile std::uint16_t value_ = 0;
};

struct Hardware {
  Bus bus;
  Output pin;
  Input handle;
  Converter converter;
  AnalogOutput analog_output;
  firmware::BoardHardware channels{bus, pins(), {}};

  firmware::BoardPins pins() {
    firmware::BoardPins pins{};
    for (auto& each : pins.step) each = &pin;
    for (auto& each : pins.direction) each = &pin;
    for (auto& each : pins.trigger) each = &pin;
    for (auto& each : pins.analog) each = &converter;
    pins.handle = &handle;
    for (auto& each : pins.dac) each = &analog_output;
    for (auto& each : pins.gpio) each = &handle;
    return pins;
  }
};

}  // namespace

extern "C" {
void r4_uart0_receive() { link.on_receive_interrupt(); }
void r4_uart0_transmit() { link.on_transmit_interrupt(); }
void r4_wake() {
  BoardClock::on_wake_interrupt();
  if (watching != nullptr && watching->tick(watch->now_ms())) feed_watchdog();
}
}

int main() {
  static BoardClock clock(r4_chance);
  static Hardware hardware;
  firmware::BoardHardware& hal = hardware.channels;
  static CanPort can(clock);
  clock.start();
  hal.power_up(clock.now_us());
  guard(hal);
  firmware::Application::Config config;
  config.identity.firmware = Text(R4LINK_VERSION);
  config.identity.board_id = Text("m7-1");
  config.identity.capabilities = Text("serial+can");
  static UserBus user_bus;
  static firmware::UserI2c i2c(user_bus);
  config.i2c = &i2c;
  static UserUartPlace uart_places[uart_channels];
  static firmware::UserUart uarts[uart_channels] = {firmware::UserUart(uart_places[0]),
                                                    firmware::UserUart(uart_places[1])};
  for (int i = 0; i < uart_channels; ++i) config.uarts[i] = &uarts[i];
  static firmware::Application application(hal, config);
  static_assert(firmware::Application::max_ports >= 2, "each port has a place");
  const std::uint8_t link_number = application.add_port(link);
  const std::uint8_t can_number = application.add_port(can);
  link.start();
  enable(Irq::uart0_rx);
  enable(Irq::uart0_tx);
  give_way(Irq::timer1);
  enable(Irq::timer1);
  start_watchdog(watchdog_ms);
  application.start(clock.now_ms());
  watch = &clock;
  watching = &application.guard();
  for (;;) {
    link.receive([&](Text datagram) {
      application.receive(link_number, everyone, datagram, clock.now_ms());
    });
    can.receive([&](Text datagram) {
      application.receive(can_number, everyone, datagram, clock.now_ms());
    });
    hal.poll(clock.now_us());
    hal.step_tick();
    application.poll(clock.now_ms());
    link.poll(clock.now_ms());
    wait_for_interrupt();
  }
}
