// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/r4/doctor/serial_checks.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "made_up_machine.hpp"
#include "tools/r4/doctor/udev_rules.hpp"

namespace r4::tool {
namespace {

constexpr const char* giga = "/dev/ttyACM0";

// The port belongs to root and to the group dialout. The group's id is the id of the files of this
// test.
void add_port(const MadeUpMachine& made_up, const std::string& members) {
  made_up.file(giga);
  made_up.mode(giga, 0660);
  made_up.file("/etc/group", fmt::format("root:x:0:\ndialout:x:{}:{}\n", ::getegid(), members));
}

Finding permission(const MadeUpMachine& made_up) {
  return found_by(check_port_permission(made_up.machine, giga), "serial.permission");
}

TEST(DoctorSerial, NamesTheMissingGroup) {
  MadeUpMachine made_up;
  add_port(made_up, "olga");
  const Finding finding = permission(made_up);
  EXPECT_EQ(finding.severity, Severity::error);
  EXPECT_EQ(finding.kind, ErrorKind::permission);
  EXPECT_EQ(finding.fix, "sudo usermod -aG dialout mara");
  EXPECT_EQ(finding.mending, Mending::automatic);
}

TEST(DoctorSerial, ANewMemberOfTheGroupHasToLogInAgain) {
  MadeUpMachine made_up;
  add_port(made_up, "olga,mara");
  const Finding finding = permission(made_up);
  EXPECT_EQ(finding.severity, Severity::error);
  EXPECT_EQ(finding.fix, "newgrp dialout");
}

TEST(DoctorSerial, AUserWhoMayOpenThePortIsOk) {
  MadeUpMachine made_up;
  add_port(made_up, "mara");
  made_up.machine.user.groups.insert(::getegid());
  EXPECT_EQ(permission(made_up).severity, Severity::ok);
  made_up.mode(giga, 0640);
  EXPECT_EQ(permission(made_up).severity, Severity::error) << "permission to read is not enough";
  made_up.machine.user.id = 0;
  EXPECT_EQ(permission(made_up).severity, Severity::ok) << "root may open every port";
}

TEST(DoctorSerial, AdvisesToGiveThePortToTheGroupDialout) {
  MadeUpMachine made_up;
  add_port(made_up, "mara");
  made_up.file("/etc/group", fmt::format("dialout:x:{}:mara\n", ::getegid() + 1));
  EXPECT_EQ(permission(made_up).fix,
            "sudo sh -c 'chgrp dialout /dev/ttyACM0 && chmod g+rw /dev/ttyACM0'");
}

TEST(DoctorSerial, AMissingPortIsAnError) {
  const MadeUpMachine made_up;
  EXPECT_EQ(permission(made_up).severity, Severity::error);
  EXPECT_EQ(permission(made_up).kind, ErrorKind::open);
}

TEST(DoctorSerial, FindsThePortsOfBoardsAndOfFtdiAdapters) {
  const MadeUpMachine made_up;
  for (const char* name : {"ttyACM0", "ttyACM1", "ttyUSB0", "ttyS0"}) {
    made_up.file(fmt::format("/sys/class/tty/{}/device/uevent", name));
  }
  made_up.file("/sys/class/tty/ttyACM0/idVendor", "2341\n");
  made_up.file("/sys/class/tty/ttyACM0/idProduct", "0266\n");
  made_up.file("/sys/class/tty/ttyACM1/idVendor", "1234\n");
  made_up.file("/sys/class/tty/ttyACM1/idProduct", "0266\n");
  made_up.file("/sys/class/tty/ttyUSB0/device/latency_timer", "16\n");
  EXPECT_EQ(likely_ports(made_up.machine), (std::vector<std::string>{giga, "/dev/ttyUSB0"}));
}

TEST(DoctorSerial, NamesAProgramThatHasThePortOpenButDoesNotShareIt) {
  const MadeUpMachine made_up;
  made_up.file("/proc/71/comm", "minicom\n");
  made_up.link("/proc/71/fd/3", giga);
  made_up.file("/proc/72/comm", "r4\n");
  made_up.link("/proc/72/fd/9", giga);
  made_up.link("/proc/73/fd/3", "/dev/ttyACM1");
  const Findings findings = check_port_holders(made_up.machine, giga, 72);
  ASSERT_EQ(findings.size(), 2U);
  EXPECT_EQ(findings[0].severity, Severity::ok);
  EXPECT_EQ(findings[1].severity, Severity::warning);
  EXPECT_NE(findings[1].reason.find("minicom (pid 71)"), std::string::npos);
  EXPECT_EQ(findings[1].fix, "kill 71");
  EXPECT_EQ(findings[1].mending, Mending::by_hand) << "the other program may be in use";
}

TEST(DoctorSerial, ALongLatencyTimerOfAnAdapterIsAWarning) {
  const MadeUpMachine made_up;
  EXPECT_TRUE(check_latency_timer(made_up.machine, "/dev/ttyUSB0").empty());
  made_up.file("/sys/class/tty/ttyUSB0/device/latency_timer", "16\n");
  const Finding finding =
      found_by(check_latency_timer(made_up.machine, "/dev/ttyUSB0"), "serial.latency");
  EXPECT_EQ(finding.severity, Severity::warning);
  EXPECT_EQ(finding.fix, "sudo sh -c 'echo 1 > /sys/class/tty/ttyUSB0/device/latency_timer'");
  made_up.file("/sys/class/tty/ttyUSB0/device/latency_timer", "1\n");
  EXPECT_FALSE(check_latency_timer(made_up.machine, "/dev/ttyUSB0").front().is_trouble());
}

TEST(DoctorSerial, ReportsMissingAndOutdatedUdevRules) {
  const MadeUpMachine made_up;
  const auto udev = [&] {
    return found_by(check_udev_rules(made_up.machine, udev_rules), "serial.udev");
  };
  EXPECT_EQ(udev().severity, Severity::warning);
  EXPECT_NE(udev().reason.find("missing"), std::string::npos);
  EXPECT_NE(
      udev().fix.find("r4 doctor --udev-rules | sudo sh -c 'tee /etc/udev/rules.d/70-r4.rules"),
      std::string::npos);
  made_up.file("/usr/lib/udev/rules.d/70-r4.rules", udev_rules);
  EXPECT_EQ(udev().severity, Severity::ok);
  made_up.file("/etc/udev/rules.d/70-r4.rules", "# old\n");
  EXPECT_EQ(udev().severity, Severity::warning) << "a file in /etc takes precedence";
  EXPECT_NE(udev().reason.find("another version"), std::string::npos);
}

TEST(DoctorSerial, ModemManagerIsAWarningWithoutTheUdevRules) {
  const MadeUpMachine made_up;
  const auto modems = [&] {
    return found_by(check_udev_rules(made_up.machine, udev_rules), "serial.modemmanager");
  };
  EXPECT_EQ(modems().severity, Severity::ok) << "ModemManager does not run";
  made_up.file("/proc/88/comm", "ModemManager\n");
  EXPECT_EQ(modems().severity, Severity::warning);
  made_up.file("/etc/udev/rules.d/70-r4.rules", udev_rules);
  EXPECT_EQ(modems().severity, Severity::ok);
}

TEST(DoctorSerial, ARuleOfBrlttyThatTakesTheAdapterIsFound) {
  const MadeUpMachine made_up;
  const auto brltty = [&](const std::vector<std::string>& ports) {
    return found_by(check_brltty(made_up.machine, ports), "serial.brltty");
  };
  const std::string gone = "/dev/ttyUSB7";
  EXPECT_EQ(brltty({gone}).severity, Severity::ok) << "brltty is not installed";
  const std::string rules = "/usr/lib/udev/rules.d/85-brltty.rules";
  made_up.file(rules,
               "# ENV{PRODUCT}==\"403/6001/*\", GOTO=\"brltty_usb_run\"\n"
               "ENV{PRODUCT}==\"10c4/ea60/*\", ATTRS{manufacturer}==\"Silicon Labs\", "
               "GOTO=\"brltty_usb_run\"\n");
  EXPECT_EQ(brltty({gone}).severity, Severity::ok) << "the rules match only braille displays";
  made_up.file(rules,
               "ENV{PRODUCT}==\"1a86/7523/*\", ENV{BRLTTY_BRAILLE_DRIVER}=\"bm\"\n"
               "ENV{PRODUCT}==\"403/6001/*\", ENV{BRLTTY_BRAILLE_DRIVER}=\"at\"\n");
  EXPECT_EQ(brltty({}).severity, Severity::note);
  EXPECT_EQ(brltty({"/dev/ttyACM0"}).severity, Severity::note);
  EXPECT_EQ(brltty({gone}).severity, Severity::warning);
  EXPECT_EQ(brltty({gone}).mending, Mending::by_hand) << "a blind user may need brltty";
  EXPECT_NE(brltty({gone}).reason.find("CH340, FT232"), std::string::npos);
  EXPECT_EQ(brltty({gone}).fix,
            "sudo sh -c 'ln -s /dev/null /etc/udev/rules.d/85-brltty.rules && udevadm control "
            "--reload'");
  const std::string usb = "/sys/class/tty/ttyUSB0/device";
  for (const auto& [vendor, product, severity] :
       {std::tuple{"0403", "6001", Severity::warning}, {"0403", "6015", Severity::note}}) {
    made_up.file("/dev/ttyUSB0");
    made_up.file(usb + "/uevent");
    made_up.file("/sys/class/tty/ttyUSB0/idVendor", vendor);
    made_up.file("/sys/class/tty/ttyUSB0/idProduct", product);
    EXPECT_EQ(brltty({"/dev/ttyUSB0"}).severity, severity) << product;
  }
  made_up.file("/etc/udev/rules.d/85-brltty.rules");
  EXPECT_EQ(brltty({gone}).severity, Severity::ok) << "the rules file is masked";
}

TEST(DoctorFinding, ExitCodeIsOneForWarningsAndElseThatOfTheFirstError) {
  Finding warning;
  warning.severity = Severity::warning;
  warning.kind = ErrorKind::unsupported;
  Finding error;
  error.severity = Severity::error;
  error.kind = ErrorKind::permission;
  Finding note;
  note.severity = Severity::note;
  EXPECT_EQ(exit_code({note}), 0);
  EXPECT_EQ(exit_code({note, warning}), 1);
  EXPECT_EQ(exit_code({warning, error}), 5);
}

}  // namespace
}  // namespace r4::tool
