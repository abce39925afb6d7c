// SPDX-License-Identifier: GPL-3.0-or-later
// The board on QEMU's mps2-an500: the application between UART, UDP and simulated hardware.
#include "../sim/robot/random.hpp"
#include "board_program.hpp"
#include "chip/registers.hpp"
#include "fault.hpp"
#include "pins_report.hpp"
#include "r4link/config.hpp"
#include "startup.hpp"

namespace {

using namespace r4;
using namespace r4::m7;

constexpr std::uint32_t address = 0x0A00020F;  // 10.0.2.15, QEMU's user network
constexpr std::uint16_t udp_port = 2018;
// Longer than any turn of the loop, shorter than the board's timeout.
constexpr std::uint32_t watchdog_ms = 500;

// Used by interrupt handlers.
Uart link(uart0_base);
UdpPort udp(address, udp_port);
BoardProgram* board = nullptr;

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

SafeReason cause_of(const FaultNote& note) {
  switch (note.kind) {
    case FaultNote::Kind::none:
      break;
    case FaultNote::Kind::fault:
      return SafeReason::fault;
    case FaultNote::Kind::watchdog:
      return SafeReason::watchdog;
  }
  return SafeReason::none;
}

}  // namespace

extern "C" {
void r4_uart0_receive() {
  link.on_receive_interrupt();
  if (link.take_stop()) board->on_stop();
  PinsReport::on_datagram(link.last_line_ticks());
}
void r4_uart0_transmit() { link.on_transmit_interrupt(); }
void r4_wake() {
  if (board->on_wake()) feed_watchdog();
}
void r4_ethernet() {
  udp.on_interrupt();
  if (udp.take_stop()) board->on_stop();
  PinsReport::on_datagram(BoardClock::ticks());
}
}

int main() {
  firmware::Application::Config config;
  config.identity.firmware = Text(R4LINK_VERSION);
  config.identity.board_id = Text("m7-1");
  config.identity.capabilities = Text("udp+serial");
  const std::uint64_t seed = sim::scramble(std::uint64_t{boots()} << 32 | r4_chance);
  // As random as the 32 bits of tools/m7: enough for tests.
  std::uint8_t chance[Authentication::chance_size];
  for (std::size_t i = 0; i < sizeof chance; ++i) {
    chance[i] = static_cast<std::uint8_t>(sim::scramble(seed + i));
  }
  config.chance = chance;
  static BoardProgram the_board(seed, link, udp, config);
  board = &the_board;
  board->power_up();
  guard(board->hal());
  start_watchdog(watchdog_ms);

  const FaultNote note = take_note();
  report(Log(uart1_base), note);
  static PinsReport pins(board->model(), board->clock(), board->application().link(), uart2_base);
  if (r4_wants_pins != 0) pins.start();
  link.start();
  if (!udp.start()) Log(uart1_base).text("r4: no Ethernet: UDP is off\n");

  // The handler of timer 1 may make the outputs safe, which takes longer than a UART byte.
  give_way(Irq::timer1);
  enable(Irq::uart0_rx);
  enable(Irq::uart0_tx);
  enable(Irq::timer1);
  enable(Irq::ethernet);
  board->start(cause_of(note));
  for (;;) {
    board->turn();
    if (r4_wants_pins != 0) pins.poll();
    board->rest();
  }
}
