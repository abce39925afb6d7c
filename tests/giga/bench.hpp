// SPDX-License-Identifier: GPL-3.0-or-later
// The firmware on a fake Giga, with hosts at the other ends of its transports.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "fake_giga.hpp"
#include "firmware/ports/giga/chip/timers.hpp"
#include "firmware/ports/giga/system.hpp"
#include "r4link/wiring/wiring_value.hpp"
#include "tests/support/datagrams.hpp"
#include "transports/framing/can/can_node.hpp"

extern "C" void r4_fake_core_error(std::int32_t status, std::uint32_t address);
extern "C" void r4_fake_core_warning(std::int32_t status, std::uint32_t address);

namespace r4::test {

// A host like the paper's client: its heartbeats have its own clock, and its numbers begin at 1.
class PlainHost {
 public:
  std::string heartbeat(std::uint64_t now_ms) {
    return with_crc("H:ROS2-R4;PNum:" + std::to_string(++pnum_) + ";T:" + std::to_string(now_ms) +
                    ";");
  }
  std::string command(const std::string& field) {
    return with_crc(field + ";PNum:" + std::to_string(++pnum_) + ";T:1;");
  }

 private:
  unsigned pnum_ = 0;
};

inline bool has_line(const std::vector<std::string>& lines, const std::string& part) {
  return std::any_of(lines.begin(), lines.end(),
                     [&](const std::string& line) { return line.find(part) != std::string::npos; });
}

class GigaBench {
 public:
  using Send = std::function<void(const std::string&)>;

  // A board that has this wiring, also in its settings.
  explicit GigaBench(const Wiring& wired = plan_wiring()) : giga(wired) {
    hold_handle(true);
    giga.usb_open = true;
    store("", wired);
    giga.can.on_sent = [this](const CanFrame& frame) { on_can(frame); };
  }
  ~GigaBench() { system.reset(); }

  // Stores the settings for the next boot: these lines, and a wiring, so that the board drives.
  void store(const std::string& lines) { store(lines, giga.chips.wiring); }
  void store(const std::string& lines, const Wiring& wiring) {
    char value[max_wiring_value];
    giga.stored["r4-settings"] = lines + "wiring," + str(write_wiring_value(wiring, value)) + "\n";
  }
  void hold_handle(bool held) {
    const Place handle = giga.chips.wiring.at(SignalKind::handle);
    if (!handle.connected()) return;
    const giga::Pin pin = giga::pin_of(handle);
    giga.set_pin(pin.port, pin.number, held != handle.option());
  }
  void boot() {
    system = std::make_unique<giga::System>();
    system->boot();
  }
  // Boots with a network in its settings. True if the board has joined the network.
  bool boot_in_network() {
    store("network,lab\npassword,correct%20horse\n");
    boot();
    return run_until([this] {
      const std::lock_guard<std::mutex> lock(giga.mutex);
      return giga.udp_port != 0;
    });
  }
  // Restarts the microcontroller, as after a reset or when only its own supply was off.
  void restart() {
    giga.reset_by([this] { giga.reset(); });
    system.reset();
    giga.connect_registers();
    boot();
  }
  // One turn of the loop, as in the sketch.
  void turn() {
    system->poll();
    giga::rest();
  }
  void run_ms(std::uint64_t ms) {
    const std::uint64_t end = giga.now_ms() + ms;
    while (giga.now_ms() < end) turn();
  }
  // Runs the board with a host that sends a heartbeat every 100 ms.
  void run_ms(std::uint64_t ms, PlainHost& host, const Send& send) {
    const std::uint64_t end = giga.now_ms() + ms;
    for (std::uint64_t next = giga.now_ms(); giga.now_ms() < end; turn()) {
      if (giga.now_ms() < next) continue;
      send(host.heartbeat(giga.now_ms()));
      next += 100;
    }
  }
  // Runs the board until `done`, and gives the firmware's threads time. True if `done` became true
  // in time.
  bool run_until(const std::function<bool()>& done) {
    for (int i = 0; i < 20000; ++i) {
      if (done()) return true;
      turn();
      std::this_thread::sleep_for(std::chrono::microseconds(20));
    }
    return false;
  }

  // --- the hosts' ends of the transports
  Send usb() {
    return [this](const std::string& line) { giga.usb_send(line + "\r\n"); };
  }
  Send udp(std::uint32_t ip = host_ip, std::uint16_t port = 40000) {
    return [this, ip, port](const std::string& bytes) {
      const std::lock_guard<std::mutex> lock(giga.mutex);
      giga.udp_in.push_back({ip, port, bytes});
    };
  }
  Send can() {
    return [this](const std::string& bytes) {
      can_node.begin(Text(bytes.data(), bytes.size()), now_us());
      pump_can();
    };
  }
  std::uint32_t now_us() const { return static_cast<std::uint32_t>(giga.now_ns() / 1000); }

  std::vector<std::string> usb_lines() {
    std::vector<std::string> lines;
    std::size_t end = 0;
    while ((end = giga.usb_host.find("\r\n")) != std::string::npos) {
      lines.push_back(giga.usb_host.substr(0, end));
      giga.usb_host.erase(0, end + 2);
    }
    return lines;
  }

  // The lines of the answer to "report".
  std::vector<std::string> report() {
    usb_lines();
    usb()("report");
    run_ms(500);
    return usb_lines();
  }

  const firmware::Application& application() { return system->board().application(); }
  SafeReason reason() { return application().reason(); }
  bool active() { return application().state() == firmware::BoardState::active; }
  sim::ChipPins pins() const { return giga.chips.pins(); }

  // A host takes control over `send` and sets OSMC 1 to 358.
  void drive(PlainHost& host, const Send& send) {
    run_ms(150, host, send);
    send(host.command("O:358,1,1"));
    run_ms(20);
    ASSERT_EQ(pins().osmc[0].pwm, 358);
  }

  static constexpr std::uint32_t host_ip = 192U << 24 | 168U << 16 | 117;

  fake::Giga giga;
  std::unique_ptr<giga::System> system;
  CanNode can_node{CanEnd::host, 1, false};
  std::vector<std::string> can_datagrams;
  std::vector<CanFrame> can_raw;  // frames that belong to no datagram

 private:
  void on_can(const CanFrame& frame) {
    if (frame.id < 0x180) can_raw.push_back(frame);
    const Text datagram = can_node.on_frame(frame, now_us());
    if (!datagram.empty()) can_datagrams.push_back(str(datagram));
    pump_can();
  }
  void pump_can() {
    CanFrame frame;
    while (can_node.offer(now_us(), frame)) {
      giga.can.deliver(frame);
      can_node.frame_sent(now_us());
    }
  }
};

}  // namespace r4::test
