// SPDX-License-Identifier: GPL-3.0-or-later
#include "system_checks.hpp"

#include <fmt/format.h>
#include <sys/timex.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>
#include <string_view>

namespace r4::tool {
namespace {

// Bytes, enough for 200 states: the default of Linux. A CAN socket requests more, and works with
// less.
constexpr long least_receive_buffer = 212992;
constexpr double noticeable_step_s = 0.010;
constexpr const char* host_port = "2390";
constexpr const char* board_port = "2018";

Finding found(Severity severity, const char* check, std::string thing, std::string reason,
              std::string fix = {}, Mending mending = Mending::by_hand) {
  return {severity,       check,   std::move(thing), std::move(reason),
          std::move(fix), mending, ErrorKind::data};
}

void check_receive_buffer(const Machine& machine, Findings& findings) {
  const std::string file = "/proc/sys/net/core/rmem_max";
  const std::optional<std::string> text = machine.read(file);
  if (!text) return;
  const long bytes = std::strtol(text->c_str(), nullptr, 10);
  if (bytes >= least_receive_buffer) return;
  findings.push_back(found(
      Severity::warning, "network.buffer", "net.core.rmem_max",
      fmt::format("{} bytes: datagrams that arrive while a program is paused are lost", bytes),
      machine.as_root(fmt::format("sysctl -w net.core.rmem_max={}", least_receive_buffer)),
      Mending::automatic));
}

void check_power_saving(const Machine& machine, Findings& findings) {
  for (const std::string& name : machine.list("/sys/class/net")) {
    if (!machine.exists("/sys/class/net/" + name + "/phy80211")) continue;
    const std::string says = machine.run(fmt::format("iw dev {} get power_save", name));
    if (says.find(": on") == std::string::npos) continue;
    findings.push_back(found(Severity::warning, "network.powersave", name,
                             "power saving of WiFi is on: datagrams wait up to a few hundred ms",
                             machine.as_root(fmt::format("iw dev {} set power_save off", name)),
                             Mending::automatic));
  }
}

bool lets_in(std::string_view rules) {
  return rules.find(host_port) != std::string_view::npos ||
         rules.find(board_port) != std::string_view::npos;
}

// The words between `keyword` and the brace: "inet filter" of "table inet filter {".
std::string last_named(std::string_view rules, std::string_view keyword, std::size_t at) {
  const std::size_t begin = rules.rfind(keyword, at);
  if (begin == std::string_view::npos) return "";
  const std::string_view rest = rules.substr(begin + keyword.size());
  const std::size_t end = rest.find(" {");
  return std::string(rest.substr(0, end));
}

// Recognizes only an input chain that drops by default and has no rule for R4's ports.
void check_firewall(const Machine& machine, Findings& findings) {
  const bool there =
      machine.exists("/proc/sys/net/netfilter") || machine.exists("/proc/net/ip_tables_names");
  if (!there) return;
  if (!machine.user.is_root()) {
    findings.push_back(found(Severity::note, "network.firewall", "firewall",
                             "only root can read the rules", "sudo r4 doctor"));
    return;
  }
  const std::string nft = machine.run("nft list ruleset");
  const std::string iptables = machine.run("iptables -S INPUT");
  const std::size_t hook = nft.find("hook input");
  const bool nft_drops =
      hook != std::string::npos && nft.find("policy drop", hook) < nft.find('\n', hook);
  const bool iptables_drops = iptables.starts_with("-P INPUT DROP");
  if (nft_drops && !lets_in(nft)) {
    findings.push_back(found(
        Severity::warning, "network.firewall", "nft",
        "drops datagrams from boards: no rule names UDP port 2018 or 2390",
        fmt::format("nft insert rule {} {} udp sport {} accept", last_named(nft, "table ", hook),
                    last_named(nft, "chain ", hook), board_port)));
  } else if (iptables_drops && !lets_in(iptables)) {
    findings.push_back(
        found(Severity::warning, "network.firewall", "iptables",
              "drops datagrams from boards: no rule names UDP port 2018 or 2390",
              fmt::format("iptables -I INPUT -p udp --sport {} -j ACCEPT", board_port)));
  } else if (iptables.empty() && machine.run("nft --version").empty()) {
    findings.push_back(found(Severity::note, "network.firewall", "firewall",
                             "nft and iptables do not show their rules", "apt install nftables"));
  } else {
    findings.push_back(
        found(Severity::ok, "network.firewall", "firewall", "accepts datagrams from boards"));
  }
}

}  // namespace

Findings check_network(const Machine& machine) {
  Findings findings;
  check_receive_buffer(machine, findings);
  check_power_saving(machine, findings);
  check_firewall(machine, findings);
  return findings;
}

bool clock_is_synchronized() {
  timex state{};
  return ::adjtimex(&state) >= 0 && (state.status & STA_UNSYNC) == 0;
}

Findings check_clock(bool synchronized) {
  if (synchronized)
    return {found(Severity::ok, "clock", "wall clock", "is synchronized by NTP or PTP")};
  return {found(Severity::note, "clock", "wall clock",
                "is not synchronized: times in recordings of different computers do not match",
                "timedatectl set-ntp true")};
}

Findings check_clock_steps(double seconds) {
  if (std::abs(seconds) < noticeable_step_s) return {};
  return {
      found(Severity::warning, "clock.step", "wall clock",
            fmt::format("was changed by {:+.3f} s during the check: links continue, but logs of "
                        "different computers do not match",
                        seconds),
            "timedatectl timesync-status")};
}

Findings check_processors(const Machine& machine) {
  Findings findings;
  long processors = 0;
  std::string slow;
  const std::string folder = "/sys/devices/system/cpu";
  for (const std::string& name : machine.list(folder)) {
    const bool is_one =
        name.size() > 3 && name.starts_with("cpu") && name[3] >= '0' && name[3] <= '9';
    if (!is_one) continue;
    ++processors;
    const std::string frequency = fmt::format("{}/{}/cpufreq/", folder, name);
    const std::string driver = machine.read(frequency + "scaling_driver").value_or("");
    // Drivers that choose the frequency themselves use "powersave" only as a name.
    const bool chooses = driver == "intel_pstate" || driver == "amd-pstate-epp";
    if (!chooses && machine.read(frequency + "scaling_governor") == "powersave") slow = name;
  }
  if (!slow.empty()) {
    findings.push_back(
        found(Severity::warning, "processor.governor", slow,
              "powersave: the processor keeps its lowest frequency at any load",
              machine.as_root(
                  "echo performance | tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor")));
  }
  const std::optional<std::string> loads = machine.read("/proc/loadavg");
  const double load = std::strtod(loads.value_or("0").c_str(), nullptr);
  if (processors > 0 && load > 1.5 * static_cast<double>(processors)) {
    findings.push_back(
        found(Severity::warning, "processor.load", "processors",
              fmt::format("{:.1f} programs compete for {} processors, so links are delayed", load,
                          processors),
              "top"));
  }
  if (findings.empty() && processors > 0 && loads) {
    findings.push_back(found(Severity::ok, "processor", "processors",
                             fmt::format("{}, load {:.1f}", processors, load)));
  }
  return findings;
}

}  // namespace r4::tool
