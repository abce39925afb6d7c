// SPDX-License-Identifier: GPL-3.0-or-later
// Not a board: what one with CAN and a UART would link, for `tools/m7 --size`. No machine that QEMU
// has with a Cortex-M has a CAN controller, so its frames go nowhere.
#include "../../../transports/framing/can_node.hpp"
#include "../../application.hpp"
#include "board_clock.hpp"
#include "fault.hpp"
#include "registers.hpp"
#include "startup.hpp"
#include "uart.hpp"

namespace {

using namespace r4;
using namespace r4::mps2;

Uart link(uart0_base);

// The place of a controller: two mailboxes.
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
  void send(Text datagram, firmware::Urgency, std::uint32_t) override {
    node_.begin(datagram, clock_.now_us());
  }
  std::size_t max_size() const override { return max_datagram; }
  void use_packed_form(bool wanted) override { node_.use_packed_form(wanted); }

 private:
  BoardClock& clock_;
  CanNode node_{CanEnd::board, 1, false};
};

// The channels as they were told; a board has chips here.
class Hal final : public firmware::Hal {
 public:
  void apply(const firmware::Outputs& outputs) override { outputs_ = outputs; }
  void make_safe() override { outputs_ = firmware::Outputs(); }
  void sample(firmware::Inputs& inputs) override { inputs = inputs_; }
  void zero(int channel) override { inputs_.encoder_counts[channel - 1] = 0; }

 private:
  firmware::Outputs outputs_;
  firmware::Inputs inputs_;
};

}  // namespace

extern "C" {
void r4_uart0_receive() { link.on_receive_interrupt(); }
void r4_uart0_transmit() { link.on_transmit_interrupt(); }
void r4_wake() { BoardClock::on_wake_interrupt(); }
}

int main() {
  static BoardClock clock(r4_chance);
  static Hal hal;
  static CanPort can(clock);
  clock.start();
  guard(hal);
  firmware::Application::Config config;
  config.identity.firmware = Text("0.1.0");
  config.identity.board_id = Text("mps2-1");
  config.identity.capabilities = Text("serial+can");
  static firmware::Application application(hal, config);
  const std::uint8_t link_number = application.add_port(link);
  const std::uint8_t can_number = application.add_port(can);
  link.start();
  enable(Irq::uart0_rx);
  enable(Irq::uart0_tx);
  enable(Irq::timer1);
  application.start(clock.now_ms());
  for (;;) {
    link.receive([&](Text datagram) {
      application.receive(link_number, firmware::everyone, datagram, clock.now_ms());
    });
    can.receive([&](Text datagram) {
      application.receive(can_number, firmware::everyone, datagram, clock.now_ms());
    });
    application.poll(clock.now_ms());
    link.poll(clock.now_ms());
    wait_for_interrupt();
  }
}
