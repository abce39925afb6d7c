// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/r4/doctor/system_checks.hpp"

#include <gtest/gtest.h>

#include "made_up_machine.hpp"

namespace r4::tool {
namespace {

TEST(DoctorSystem, ASmallReceiveBufferIsAWarning) {
  const MadeUpMachine made_up;
  made_up.file("/proc/sys/net/core/rmem_max", "8192\n");
  const Finding finding = found_by(check_network(made_up.machine), "network.buffer");
  EXPECT_EQ(finding.severity, Severity::warning);
  EXPECT_EQ(finding.fix, "sudo sysctl -w net.core.rmem_max=212992");
  made_up.file("/proc/sys/net/core/rmem_max", "212992\n");
  EXPECT_TRUE(check_network(made_up.machine).empty());
}

TEST(DoctorSystem, PowerSavingOfWiFiIsAWarning) {
  MadeUpMachine made_up;
  made_up.file("/sys/class/net/eth0/type", "1\n");
  made_up.file("/sys/class/net/wlan0/phy80211/name", "phy0\n");
  made_up.says["iw dev wlan0 get power_save"] = "Power save: off\n";
  EXPECT_TRUE(check_network(made_up.machine).empty());
  made_up.says["iw dev wlan0 get power_save"] = "Power save: on\n";
  EXPECT_EQ(found_by(check_network(made_up.machine), "network.powersave").fix,
            "sudo iw dev wlan0 set power_save off");
}

TEST(DoctorSystem, AFirewallThatDropsTheR4PortsIsAWarning) {
  MadeUpMachine made_up;
  const auto firewall = [&] {
    return found_by(check_network(made_up.machine), "network.firewall");
  };
  made_up.file("/proc/sys/net/netfilter/nf_log_all_netns", "0\n");
  EXPECT_EQ(firewall().severity, Severity::note) << "only root can read the rules";
  made_up.machine.user.id = 0;
  EXPECT_EQ(firewall().severity, Severity::note) << "neither program is installed";
  made_up.says["nft --version"] = "nftables v1.0.6\n";
  EXPECT_EQ(firewall().severity, Severity::ok);
  const std::string chain =
      "table inet filter {\n chain input {\n  type filter hook input priority filter; policy ";
  made_up.says["nft list ruleset"] = chain + "drop;\n  tcp dport 22 accept\n }\n}\n";
  EXPECT_EQ(firewall().severity, Severity::warning);
  EXPECT_EQ(firewall().mending, Mending::by_hand);
  EXPECT_EQ(firewall().fix, "nft insert rule inet filter input udp sport 2018 accept");
  made_up.says["nft list ruleset"] = chain + "drop;\n  udp sport 2018 accept\n }\n}\n";
  EXPECT_EQ(firewall().severity, Severity::ok);
  made_up.says["nft list ruleset"] = chain + "accept;\n }\n chain forward { policy drop; }\n}\n";
  EXPECT_EQ(firewall().severity, Severity::ok) << "the policy belongs to another chain";
  made_up.says["iptables -S INPUT"] = "-P INPUT DROP\n-A INPUT -p tcp -j ACCEPT\n";
  EXPECT_EQ(firewall().thing, "iptables");
}

TEST(DoctorSystem, SlowAndBusyProcessorsAreWarnings) {
  const MadeUpMachine made_up;
  const auto governor = [&] {
    return found_by(check_processors(made_up.machine), "processor.governor");
  };
  made_up.file("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "powersave\n");
  made_up.file("/sys/devices/system/cpu/cpu0/cpufreq/scaling_driver", "intel_pstate\n");
  made_up.file("/sys/devices/system/cpu/cpuidle/current_driver", "none\n");
  made_up.file("/proc/loadavg", "1.40 0.2 0.1 1/2 3\n");
  EXPECT_EQ(check_processors(made_up.machine).front().severity, Severity::ok);
  made_up.file("/sys/devices/system/cpu/cpu0/cpufreq/scaling_driver", "acpi-cpufreq\n");
  EXPECT_EQ(governor().severity, Severity::warning);
  made_up.file("/proc/loadavg", "1.60 0.2 0.1 1/2 3\n");
  EXPECT_EQ(found_by(check_processors(made_up.machine), "processor.load").severity,
            Severity::warning);
}

TEST(DoctorSystem, AnUnsynchronizedClockIsANoteAndAClockStepIsAWarning) {
  EXPECT_EQ(check_clock(true).front().severity, Severity::ok);
  EXPECT_EQ(check_clock(false).front().severity, Severity::note);
  EXPECT_TRUE(check_clock_steps(0.001).empty());
  EXPECT_EQ(check_clock_steps(-3600).front().severity, Severity::warning);
}

}  // namespace
}  // namespace r4::tool
