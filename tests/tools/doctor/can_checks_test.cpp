// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/r4/doctor/can_checks.hpp"

#include <gtest/gtest.h>

#include "made_up_machine.hpp"

namespace r4::tool {
namespace {

CanInterface good_interface() {
  CanInterface interface;
  interface.name = "can0";
  interface.exists = interface.is_can = interface.up = interface.has_controller = true;
  interface.state = "error-active";
  interface.bit_rate = 1000000;
  interface.restart_ms = 100;
  interface.tx_queue = 1000;
  return interface;
}

Finding only_finding(const CanInterface& interface) {
  const MadeUpMachine made_up;
  const Findings findings = check_can_interface(made_up.machine, interface);
  EXPECT_EQ(findings.size(), 1U);
  return findings.front();
}

TEST(DoctorCan, AHealthyInterfaceIsOk) {
  EXPECT_EQ(only_finding(good_interface()).severity, Severity::ok);
  CanInterface virtual_bus = good_interface();
  virtual_bus.has_controller = false;
  virtual_bus.bit_rate = virtual_bus.restart_ms = virtual_bus.tx_queue = 0;
  EXPECT_EQ(only_finding(virtual_bus).severity, Severity::ok);
}

TEST(DoctorCan, AMissingInterfaceHasTheKindUnsupported) {
  CanInterface interface;
  interface.name = "can7";
  EXPECT_EQ(only_finding(interface).check, "can.missing");
  EXPECT_EQ(only_finding(interface).kind, ErrorKind::unsupported);
}

TEST(DoctorCan, BringsAnInterfaceUpUnlessItsBitRateIsUnknown) {
  CanInterface interface = good_interface();
  interface.up = false;
  EXPECT_EQ(only_finding(interface).check, "can.down");
  EXPECT_EQ(only_finding(interface).mending, Mending::automatic);
  EXPECT_EQ(only_finding(interface).fix,
            "sudo ip link set can0 up txqueuelen 1000 type can restart-ms 100");
  interface.bit_rate = 0;
  EXPECT_EQ(only_finding(interface).mending, Mending::by_hand);
  EXPECT_NE(only_finding(interface).fix.find("bitrate 1000000"), std::string::npos);
}

TEST(DoctorCan, NoAutomaticRestartAndAShortQueueAreReported) {
  CanInterface interface = good_interface();
  interface.restart_ms = 0;
  EXPECT_EQ(only_finding(interface).check, "can.restart");
  EXPECT_EQ(only_finding(interface).mending, Mending::by_hand)
      << "the command takes the interface down";
  interface = good_interface();
  interface.tx_queue = 10;
  EXPECT_EQ(only_finding(interface).check, "can.queue");
  EXPECT_EQ(only_finding(interface).fix, "sudo ip link set can0 txqueuelen 1000");
}

TEST(DoctorCan, BusOffAndErrorsAreReported) {
  CanInterface interface = good_interface();
  interface.state = "bus-off";
  interface.tx_errors = 248;
  EXPECT_EQ(only_finding(interface).check, "can.busoff");
  EXPECT_EQ(only_finding(interface).fix, "sudo ip link set can0 type can restart");
  interface.state = "error-passive";
  EXPECT_EQ(only_finding(interface).check, "can.errors");
  EXPECT_NE(only_finding(interface).reason.find("tx 248"), std::string::npos);
}

TEST(DoctorCan, ABusOffOfADriverThatCannotRestartIsEndedByDownAndUp) {
  const MadeUpMachine made_up;
  made_up.file("/sys/class/net/can0/device/uevent", "DEVTYPE=usb_interface\nDRIVER=gs_usb\n");
  CanInterface interface = good_interface();
  interface.restart_ms = 0;
  EXPECT_EQ(check_can_interface(made_up.machine, interface).front().severity, Severity::ok);
  interface.state = "bus-off";
  EXPECT_EQ(found_by(check_can_interface(made_up.machine, interface), "can.busoff").fix,
            "sudo sh -c 'ip link set can0 down && ip link set can0 up'");
  interface.up = false;
  EXPECT_EQ(check_can_interface(made_up.machine, interface).front().fix,
            "sudo ip link set can0 up txqueuelen 1000");
}

TEST(DoctorCan, FramesOfAnotherProtocolOnAnIdOfTheBoardAreNamed) {
  CanSurvey survey({1000000, 0});
  CanFrame frame{};
  frame.size = 8;
  for (const std::uint32_t id : {0x185U, 0x186U, 0x705U}) {
    frame.id = id;
    survey.on_frame(frame, 0);
  }
  const Findings findings = check_foreign_frames(survey, "can0", 5);
  ASSERT_EQ(findings.size(), 1U) << "the other ids do not belong to board 5";
  EXPECT_EQ(findings[0].severity, Severity::warning);
  EXPECT_EQ(findings[0].reason,
            "1 frames with id 185, an id of board 5, are not R4 datagrams: CANopen TPDO1 of "
            "node 5, or ODrive axis 12");
}

TEST(DoctorCan, AFullBusIsAWarning) {
  EXPECT_EQ(check_can_load("can0", 0.79).front().severity, Severity::ok);
  EXPECT_EQ(check_can_load("can0", 0.81).front().severity, Severity::warning);
}

TEST(DoctorCan, AdvisesHowToGetCanInTheKernel) {
  const MadeUpMachine made_up;
  made_up.file("/proc/sys/kernel/osrelease", "6.1.0\n");
  EXPECT_EQ(check_can_kernel(made_up.machine).front().fix, "tools/with-can r4 list");
  made_up.file("/lib/modules/6.1.0/kernel/net/can/can.ko");
  EXPECT_EQ(check_can_kernel(made_up.machine).front().fix, "sudo modprobe can-raw");
  made_up.file("/proc/net/can/stats");
  EXPECT_EQ(check_can_kernel(made_up.machine).front().severity, Severity::ok);
}

}  // namespace
}  // namespace r4::tool
