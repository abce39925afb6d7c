// SPDX-License-Identifier: GPL-3.0-or-later
// The application on simulated hardware, between a UART and UDP.
#pragma once

#include <cstdint>

#include "../../application/application.hpp"
#include "../sim/simulated_hardware.hpp"
#include "chip/board_clock.hpp"
#include "fault.hpp"
#include "links/uart.hpp"
#include "links/udp_port.hpp"
#include "startup.hpp"
#include "wire_time.hpp"

namespace r4 {
namespace m7 {

class BoardProgram {
  static_assert(firmware::Application::max_ports >= 2, "each port has a place");

 public:
  BoardProgram(std::uint64_t seed, Uart& link, UdpPort& udp,
               const firmware::Application::Config& config)
      : clock_(static_cast<std::uint32_t>(seed)),
        model_(seed),
        hardware_(model_),
        application_(hardware_.hal(), with_devices(config, hardware_)),
        link_(link),
        udp_(udp),
        link_number_(application_.add_port(link)),
        udp_number_(application_.add_port(udp)) {
    model_.chips().bus.set_processor(&wire_);
  }

  void power_up() {  // call first: switches the outputs off
    clock_.start();
    hardware_.power_up();
  }
  // `cause`: the fault or watchdog that ended the last boot; otherwise none.
  void start(SafeReason cause) {
    application_.start(clock_.now_ms());
    if (cause != SafeReason::none) application_.fail(cause, clock_.now_ms());
    passed_ms_ = clock_.now_ms();
    started_ = true;
  }
  void turn() {
    for (; passed_ms_ != clock_.now_ms(); ++passed_ms_) hardware_.pass_millisecond();
    link_.receive([this](Text datagram) {
      application_.receive(link_number_, everyone, datagram, clock_.now_ms());
      hal().calibrate(application_.settings().site.full_scale_cv);  // the datagram may be C:AIN24,…
    });
    if (!link_.has_received()) application_.drained(link_number_);
    udp_.receive([this](std::uint32_t peer, Text datagram) {
      application_.receive(udp_number_, peer, datagram, clock_.now_ms());
    });
    if (!udp_.has_received()) application_.drained(udp_number_);
    const std::uint32_t now_ms = clock_.now_ms();
    application_.poll(now_ms);
    link_.poll(now_ms);
  }
  // Without work, sleeps until an interrupt. Interrupts stay off, so that no interrupt is missed.
  void rest() {
    const InterruptsHeld held;
    if (!link_.has_received() && !udp_.has_received()) wait_for_interrupt();
  }

  // In timer 1's interrupt, each millisecond. True: the watchdog may be fed.
  bool on_wake() {
    if (!canary_alive()) halt();
    BoardClock::on_wake_interrupt();
    return started_ && application_.guard().tick(clock_.now_ms());
  }

  // For a received stop. Call in an interrupt: the interrupt of timer 1 then follows at once.
  void on_stop() {
    application_.guard().stop();
    pend(Irq::timer1);
  }

  BoardClock& clock() { return clock_; }
  sim::BoardModel& model() { return model_; }
  firmware::BoardHardware& hal() { return hardware_.hal(); }
  firmware::Application& application() { return application_; }

 private:
  static firmware::Application::Config with_devices(firmware::Application::Config config,
                                                    sim::SimulatedHardware& hardware) {
    hardware.add_devices(config);
    return config;
  }

  BoardClock clock_;
  WireTime wire_;
  sim::BoardModel model_;
  sim::SimulatedHardware hardware_;
  firmware::Application application_;
  Uart& link_;
  UdpPort& udp_;
  std::uint8_t link_number_;
  std::uint8_t udp_number_;
  std::uint32_t passed_ms_ = 0;  // on the simulated hardware
  volatile bool started_ = false;
};

}  // namespace m7
}  // namespace r4
