// SPDX-License-Identifier: GPL-3.0-or-later
// The board on an MPS2 with AN500: the application between a UART, UDP and the hardware.
#include "../../application.hpp"
#include "../sim/random.hpp"
#include "../sim/simulated_hardware.hpp"
#include "board_clock.hpp"
#include "fault.hpp"
#include "pins_report.hpp"
#include "registers.hpp"
#include "startup.hpp"
#include "uart.hpp"
#include "udp_port.hpp"
#include "wire_time.hpp"

namespace {

using namespace r4;
using namespace r4::mps2;

constexpr std::uint32_t address = 0x0A00020F;  // 10.0.2.15, QEMU's user network
constexpr std::uint16_t udp_port = 2018;
// Longer than any turn of the loop, shorter than the board's timeout.
constexpr std::uint32_t watchdog_ms = 500;

// What interrupt handlers need lives here, and only here.
Uart link(uart0_base);
firmware::Guard* watching = nullptr;  // once the loop begins
BoardClock* watch = nullptr;

void report(const Log& log, const FaultNote& note) {
  log.text("r4: boot ").number(boots()).text(": ");
  switch (note.kind) {
    case FaultNote::Kind::none:
      log.text("all outputs off\n");
      break;
    case FaultNote::Kind::fault:
      log.text("after a fault (exception ").number(note.exception);
      log.text(", pc ").hex(note.pc).text(", cfsr ").hex(note.cfsr);
      log.text(", address ").hex(note.address).text("); outputs off until E:CLEAR\n");
      break;
    case FaultNote::Kind::watchdog:
      log.text("the loop hung (pc ").hex(note.pc).text("); outputs off until E:CLEAR\n");
      break;
  }
}

// Sleeps until an interrupt, unless there is work. With interrupts off nothing comes between.
void rest(const UdpPort& udp) {
  interrupts_off();
  if (!link.has_received() && !udp.has_received()) wait_for_interrupt();
  interrupts_on();
}

}  // namespace

extern "C" {
void r4_uart0_receive() {
  link.on_receive_interrupt();
  PinsReport::on_datagram(link.last_line_ticks());
}
void r4_uart0_transmit() { link.on_transmit_interrupt(); }
void r4_wake() {
  BoardClock::on_wake_interrupt();
  if (watching != nullptr && watching->tick(watch->now_ms())) feed_watchdog();
}
void r4_ethernet() {
  Lan9118::on_interrupt();
  PinsReport::on_datagram(BoardClock::ticks());
}
}

int main() {
  const std::uint64_t seed = sim::scramble(std::uint64_t{boots()} << 32 | r4_chance);
  static BoardClock clock(static_cast<std::uint32_t>(seed));
  static WireTime wire;
  static sim::BoardModel board(seed);
  board.chips().bus.set_processor(&wire);
  static sim::SimulatedHardware hardware(board);
  firmware::BoardHardware& hal = hardware.hal();
  clock.start();
  hardware.power_up();
  guard(hal);
  start_watchdog(watchdog_ms);

  const FaultNote note = take_note();
  report(Log(uart1_base), note);

  static UdpPort udp(address, udp_port);
  link.start();
  if (!udp.start()) Log(uart1_base).text("r4: no Ethernet: UDP is off\n");

  firmware::Application::Config config;
  config.identity.firmware = Text("0.1.0");
  config.identity.board_id = Text("mps2-1");
  config.identity.capabilities = Text("udp+serial");
  static firmware::Application application(hal, config);
  const std::uint8_t link_number = application.add_port(link);
  const std::uint8_t udp_number = application.add_port(udp);

  static PinsReport pins(board, clock, application.link(), uart2_base);
  if (r4_wants_pins != 0) pins.start();

  enable(Irq::uart0_rx);
  enable(Irq::uart0_tx);
  give_way(Irq::timer1);  // the safe state takes longer than a byte
  enable(Irq::timer1);
  enable(Irq::ethernet);
  interrupts_on();
  application.start(clock.now_ms());
  if (note.kind != FaultNote::Kind::none) {
    application.fail(
        note.kind == FaultNote::Kind::watchdog ? SafeReason::watchdog : SafeReason::fault,
        clock.now_ms());
  }

  watch = &clock;
  watching = &application.guard();
  std::uint32_t passed_ms = clock.now_ms();
  for (;;) {
    if (!canary_alive()) halt();
    for (; passed_ms != clock.now_ms(); ++passed_ms) hardware.pass_millisecond();
    link.receive([&](Text datagram) {
      application.receive(link_number, firmware::everyone, datagram, clock.now_ms());
    });
    udp.receive([&](std::uint32_t peer, Text datagram) {
      application.receive(udp_number, peer, datagram, clock.now_ms());
    });
    const std::uint32_t now_ms = clock.now_ms();
    application.poll(now_ms);
    link.poll(now_ms);
    if (r4_wants_pins != 0) pins.poll();
    rest(udp);
  }
}
