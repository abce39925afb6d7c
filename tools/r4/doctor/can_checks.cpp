// SPDX-License-Identifier: GPL-3.0-or-later
#include "can_checks.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "../bus/foreign_ids.hpp"

namespace r4::tool {
namespace {

// With a shorter transmit queue, programs lose frames of a plain state.
constexpr std::uint32_t least_queue = 100;
// ISO 11898-1: error-warning limit. At 128 the controller becomes error-passive.
constexpr int many_errors = 96;
constexpr double nearly_full = 0.8;

Finding about(const CanInterface& interface, Severity severity, const char* check) {
  return {severity, check, interface.name, "", "", Mending::by_hand, ErrorKind::open};
}

// The kernel's gs_usb cannot restart a controller, so newer kernels refuse `restart-ms`.
bool can_restart(const Machine& machine, const CanInterface& interface) {
  const std::string device =
      machine.read("/sys/class/net/" + interface.name + "/device/uevent").value_or("");
  return device.find("DRIVER=gs_usb") == std::string::npos;
}

// A wrong bit rate destroys the frames of all other nodes, so only the owner may choose the rate.
Finding down(const Machine& machine, const CanInterface& interface) {
  Finding finding = about(interface, Severity::error, "can.down");
  const bool restarts = can_restart(machine, interface);
  finding.reason = "the interface is down";
  if (!interface.has_controller) {
    finding.fix = machine.as_root(fmt::format("ip link set {} up", interface.name));
    finding.mending = Mending::automatic;
  } else if (interface.bit_rate == 0) {
    finding.reason +=
        ", and has no bit rate; the bit rate of a board is 1000000 unless you have changed it";
    finding.fix =
        machine.as_root(fmt::format("ip link set {} up txqueuelen 1000 type can bitrate 1000000 "
                                    "sample-point 0.875{}",
                                    interface.name, restarts ? " restart-ms 100" : ""));
  } else {
    finding.reason += fmt::format("; its bit rate is {}", interface.bit_rate);
    finding.fix = machine.as_root(fmt::format("ip link set {} up txqueuelen 1000{}", interface.name,
                                              restarts ? " type can restart-ms 100" : ""));
    finding.mending = Mending::automatic;
  }
  return finding;
}

Finding bus_off(const Machine& machine, const CanInterface& interface) {
  Finding finding = about(interface, Severity::error, "can.busoff");
  finding.reason =
      "bus-off: the controller has stopped, because no node acknowledges its frames or the bit "
      "rates differ";
  finding.fix = machine.as_root(
      can_restart(machine, interface)
          ? fmt::format("ip link set {} type can restart", interface.name)
          : fmt::format("ip link set {0} down && ip link set {0} up", interface.name));
  finding.mending = Mending::automatic;
  return finding;
}

void check_controller(const Machine& machine, const CanInterface& interface, Findings& findings) {
  if (interface.state == "bus-off") findings.push_back(bus_off(machine, interface));
  const int errors = std::max(interface.tx_errors, interface.rx_errors);
  if (interface.state != "bus-off" &&
      (errors >= many_errors || interface.state == "error-passive" ||
       interface.state == "error-warning")) {
    Finding finding = about(interface, Severity::warning, "can.errors");
    finding.reason = fmt::format(
        "{}, error counters tx {} rx {}: the wiring, the termination or a bit rate is wrong, or "
        "the bus has no other node",
        interface.state, interface.tx_errors, interface.rx_errors);
    finding.fix = fmt::format("candump -e {},0:0,#FFFFFFFF", interface.name);
    findings.push_back(finding);
  }
  // The kernel's slcan driver reports no bit rate and cannot restart.
  if (interface.restart_ms == 0 && interface.bit_rate != 0 && can_restart(machine, interface)) {
    Finding finding = about(interface, Severity::warning, "can.restart");
    finding.reason = "restart-ms is 0: a bus-off lasts until you restart the controller";
    finding.fix = machine.as_root(fmt::format(
        "ip link set {0} down && ip link set {0} up type can restart-ms 100", interface.name));
    findings.push_back(finding);
  }
}

}  // namespace

Findings check_can_kernel(const Machine& machine) {
  Finding finding{Severity::ok, "can.kernel", "SocketCAN",           "is available",
                  "",           {},           ErrorKind::unsupported};
  if (machine.exists("/proc/net/can")) return {finding};
  finding.severity = Severity::note;
  const std::string release = machine.read("/proc/sys/kernel/osrelease").value_or("");
  if (machine.exists("/lib/modules/" + release + "/kernel/net/can")) {
    finding.reason = "is not loaded";
    finding.fix = machine.as_root("modprobe can-raw");
    finding.mending = Mending::automatic;
  } else {
    finding.reason = "this kernel does not support CAN";
    finding.fix = "tools/with-can r4 list";
  }
  return {finding};
}

Findings check_can_interface(const Machine& machine, const CanInterface& interface) {
  if (!interface.exists) {
    Finding finding = about(interface, Severity::error, "can.missing");
    finding.reason =
        "the interface does not exist: plug its adapter in, or create a virtual interface";
    finding.fix = machine.as_root(fmt::format("ip link add {} type vcan", interface.name));
    finding.kind = ErrorKind::unsupported;
    return {finding};
  }
  if (!interface.is_can) {
    Finding finding = about(interface, Severity::error, "can.missing");
    finding.reason = "is not a CAN interface";
    finding.fix = "r4 list";
    finding.kind = ErrorKind::unsupported;
    return {finding};
  }
  if (!interface.up) return {down(machine, interface)};
  Findings findings;
  if (interface.has_controller) check_controller(machine, interface, findings);
  if (interface.has_controller && interface.tx_queue < least_queue) {
    Finding finding = about(interface, Severity::warning, "can.queue");
    finding.reason = fmt::format(
        "txqueuelen is {}: programs that send many frames at once lose frames", interface.tx_queue);
    finding.fix = machine.as_root(fmt::format("ip link set {} txqueuelen 1000", interface.name));
    finding.mending = Mending::automatic;
    findings.push_back(finding);
  }
  if (findings.empty()) {
    Finding finding = about(interface, Severity::ok, "can.interface");
    finding.reason = interface.has_controller ? fmt::format("up, {}, {} kbit/s", interface.state,
                                                            interface.bit_rate / 1000.0)
                                              : "up, virtual";
    findings.push_back(finding);
  }
  return findings;
}

Findings check_foreign_frames(const CanSurvey& survey, const std::string& interface,
                              std::uint8_t node) {
  Findings findings;
  for (const auto& [id, traffic] : survey.traffic()) {
    const CanIdMeaning meaning = classify(id);
    const bool is_ours = meaning.kind != CanIdKind::other &&
                         meaning.kind != CanIdKind::emergency_stop && meaning.node == node;
    if (!is_ours || survey.is_r4(id)) continue;
    Finding finding{Severity::warning, "can.foreign",  interface, "", "",
                    Mending::by_hand,  ErrorKind::data};
    finding.reason =
        fmt::format("{} frames with id {:03X}, an id of board {}, are not R4 datagrams: {}",
                    traffic.frames, id, node, foreign_names(id));
    finding.fix = fmt::format("r4 bus can://{}", interface);
    findings.push_back(finding);
  }
  return findings;
}

Findings check_can_load(const std::string& interface, double load) {
  Finding finding{Severity::ok,
                  "can.load",
                  interface,
                  fmt::format("the bus is busy for {:.1f} % of the time", 100 * load),
                  "",
                  {},
                  ErrorKind::data};
  if (load > nearly_full) {
    finding.severity = Severity::warning;
    finding.fix = fmt::format("r4 bus can://{}", interface);
  }
  return {finding};
}

}  // namespace r4::tool
