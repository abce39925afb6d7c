// SPDX-License-Identifier: GPL-3.0-or-later
#include "serial_checks.hpp"

#include <fmt/format.h>
#include <grp.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <set>
#include <sstream>

namespace r4::tool {
namespace {

constexpr const char* rules_file = "70-r4.rules";
constexpr const char* dialout = "dialout";

std::string name_of_port(const std::string& path) { return path.substr(path.rfind('/') + 1); }

bool all_digits(const std::string& text) {
  return !text.empty() &&
         std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

struct Group {
  gid_t id = 0;
  std::vector<std::string> members;
};

std::optional<Group> group_of(const Machine& machine, const std::string& name) {
  std::istringstream lines(machine.read("/etc/group").value_or(""));
  for (std::string line; std::getline(lines, line);) {
    std::istringstream parts(line);
    std::string each;
    std::string unused;
    std::string id;
    std::string members;
    std::getline(parts, each, ':');
    std::getline(parts, unused, ':');
    std::getline(parts, id, ':');
    std::getline(parts, members);
    if (each != name) continue;
    Group group;
    std::from_chars(id.data(), id.data() + id.size(), group.id);
    std::istringstream names(members);
    for (std::string member; std::getline(names, member, ',');) group.members.push_back(member);
    return group;
  }
  return std::nullopt;
}

bool may_open(const struct stat& file, const User& user) {
  if (user.is_root()) return true;
  constexpr mode_t read_write = 06;
  mode_t bits = file.st_mode;
  if (file.st_uid == user.id) {
    bits >>= 6;
  } else if (user.groups.contains(file.st_gid)) {
    bits >>= 3;
  }
  return (bits & read_write) == read_write;
}

// The first folder that contains the file takes precedence (man udev).
constexpr std::array<const char*, 5> rules_folders{"/etc/udev/rules.d/", "/run/udev/rules.d/",
                                                   "/usr/local/lib/udev/rules.d/",
                                                   "/usr/lib/udev/rules.d/", "/lib/udev/rules.d/"};

std::optional<std::string> installed_rules(const Machine& machine, const std::string& name) {
  for (const char* folder : rules_folders) {
    if (auto text = machine.read(folder + name)) return text;
  }
  return std::nullopt;
}

struct Adapter {
  const char* id;
  const char* chip;
};
constexpr std::array<Adapter, 4> adapters{
    {{"1a86/7523", "CH340"}, {"10c4/ea60", "CP210x"}, {"403/6001", "FT232"}, {"403/6015", "FT-X"}}};

// True if a rule matches every adapter with that id, without a condition such as the manufacturer.
bool take(const std::string& rules, const Adapter& adapter) {
  std::istringstream lines(rules);
  for (std::string line; std::getline(lines, line);) {
    const bool names_it =
        line.find(fmt::format("ENV{{PRODUCT}}==\"{}/", adapter.id)) != std::string::npos;
    const bool is_rule = line.find_first_not_of(" \t") != line.find('#');
    if (names_it && is_rule && line.find("ATTR") == std::string::npos) return true;
  }
  return false;
}

// "1a86/7523"; empty if not USB. The path to a usb-serial tty has one level more.
std::string usb_id_of(const Machine& machine, const std::string& port) {
  for (const char* up : {"/../", "/../../"}) {
    const std::string folder = "/sys/class/tty/" + port + "/device" + up;
    std::string vendor = machine.read(folder + "idVendor").value_or("");
    if (vendor.empty()) continue;
    vendor.erase(0, vendor.find_first_not_of('0'));
    return vendor + "/" + machine.read(folder + "idProduct").value_or("");
  }
  return {};
}

std::vector<std::string> processes(const Machine& machine) {
  std::vector<std::string> pids = machine.list("/proc");
  std::erase_if(pids, [](const std::string& name) { return !all_digits(name); });
  return pids;
}

bool is_running(const Machine& machine, std::string_view program) {
  const std::vector<std::string> pids = processes(machine);
  return std::any_of(pids.begin(), pids.end(), [&](const std::string& pid) {
    return machine.read("/proc/" + pid + "/comm").value_or("") == program;
  });
}

std::string_view without_end(std::string_view text) {
  while (text.ends_with('\n')) text.remove_suffix(1);
  return text;
}

}  // namespace

std::vector<std::string> likely_ports(const Machine& machine) {
  std::vector<std::string> ports;
  for (const std::string& name : machine.list("/sys/class/tty")) {
    const std::string id = usb_id_of(machine, name);
    const bool board = id == "2341/0266" || id == "2341/0366";
    if (board || machine.exists("/sys/class/tty/" + name + "/device/latency_timer")) {
      ports.push_back("/dev/" + name);
    }
  }
  return ports;
}

Findings check_port_permission(const Machine& machine, const std::string& path) {
  Finding finding{Severity::ok, "serial.permission", path, "may be opened", "",
                  {},           ErrorKind::open};
  struct stat file {};
  if (::stat((machine.root + path).c_str(), &file) != 0) {
    finding.severity = Severity::error;
    finding.reason = "the port does not exist";
    finding.fix = "r4 list";
    return {finding};
  }
  if (may_open(file, machine.user)) return {finding};
  finding.severity = Severity::error;
  finding.kind = ErrorKind::permission;
  const std::optional<Group> group = group_of(machine, dialout);
  const std::string& user = machine.user.name;
  if (!group || group->id != file.st_gid || (file.st_mode & 060) != 060) {
    finding.reason = fmt::format(
        "permission denied for {}: the group {} may not read and write the port", user, dialout);
    finding.fix = machine.as_root(fmt::format("chgrp {0} {1} && chmod g+rw {1}", dialout, path));
  } else if (std::find(group->members.begin(), group->members.end(), user) !=
             group->members.end()) {
    finding.reason = fmt::format(
        "permission denied: {} was added to the group {} after the last login", user, dialout);
    finding.fix = fmt::format("newgrp {}", dialout);
  } else {
    finding.reason = fmt::format("permission denied: {} is not in the group {}", user, dialout);
    finding.fix = machine.as_root(fmt::format("usermod -aG {} {}", dialout, user));
    finding.mending = Mending::automatic;
  }
  return {finding};
}

Findings check_port_holders(const Machine& machine, const std::string& path, pid_t sharing) {
  Findings findings;
  if (sharing != 0) {
    findings.push_back(
        {Severity::ok,
         "serial.holder",
         path,
         fmt::format("an r4 program (pid {}) has the port open, and shares the port", sharing),
         "",
         {},
         ErrorKind::data});
  }
  for (const std::string& pid : processes(machine)) {
    if (pid == fmt::format("{}", ::getpid()) || pid == fmt::format("{}", sharing)) continue;
    const std::string fds = fmt::format("/proc/{}/fd", pid);
    for (const std::string& fd : machine.list(fds)) {
      if (machine.link(fmt::format("{}/{}", fds, fd)) != path) continue;
      const std::string program = machine.read("/proc/" + pid + "/comm").value_or("a program");
      findings.push_back(
          {Severity::warning, "serial.holder", path,
           fmt::format("{} (pid {}) has the port open and reads datagrams of the board", program,
                       pid),
           "kill " + pid, Mending::by_hand, ErrorKind::open});
      break;
    }
  }
  return findings;
}

Findings check_latency_timer(const Machine& machine, const std::string& path) {
  const std::string file = "/sys/class/tty/" + name_of_port(path) + "/device/latency_timer";
  const std::optional<std::string> ms = machine.read(file);
  if (!ms) return {};
  Finding finding{Severity::ok,
                  "serial.latency",
                  path,
                  fmt::format("the adapter may delay bytes by {} ms", *ms),
                  "",
                  {},
                  ErrorKind::data};
  if (*ms != "1") {
    finding.severity = Severity::warning;
    finding.fix = machine.as_root(fmt::format("echo 1 > {}", file));
    finding.mending = Mending::automatic;
  }
  return {finding};
}

Findings check_udev_rules(const Machine& machine, std::string_view rules) {
  Finding finding{Severity::ok, "serial.udev", rules_file, "installed", "", {}, ErrorKind::data};
  const std::optional<std::string> installed = installed_rules(machine, rules_file);
  if (installed && without_end(*installed) == without_end(rules)) return {finding};
  const bool modems = is_running(machine, "ModemManager");
  const bool keeps_off = installed && installed->find("ID_MM_DEVICE_IGNORE") != std::string::npos;
  finding.severity = Severity::warning;
  finding.reason = installed ? "the udev rules are those of another version of r4"
                             : "the udev rules are missing: they let you open a board, and prevent "
                               "programs from using the board as a modem";
  finding.fix =
      fmt::format("r4 doctor --udev-rules | {}",
                  machine.as_root(fmt::format(
                      "tee /etc/udev/rules.d/{} > /dev/null && udevadm control --reload && "
                      "udevadm trigger",
                      rules_file)));
  finding.mending = Mending::automatic;
  Findings findings{finding};
  if (modems && !keeps_off) {
    finding.check = "serial.modemmanager";
    finding.thing = "ModemManager";
    finding.reason = "is running, and sends modem commands to each new serial port";
    findings.push_back(finding);
  }
  return findings;
}

Findings check_brltty(const Machine& machine, const std::vector<std::string>& ports) {
  std::set<std::string> names;
  for (const char* folder : rules_folders) {
    for (const std::string& name : machine.list(folder)) {
      if (name.find("brltty") != std::string::npos) names.insert(name);
    }
  }
  Findings findings;
  for (const std::string& name : names) {
    const std::string rules = installed_rules(machine, name).value_or("");
    std::string chips;
    bool concerned = false;
    for (const Adapter& adapter : adapters) {
      if (!take(rules, adapter)) continue;
      chips += (chips.empty() ? "" : ", ") + std::string(adapter.chip);
      concerned =
          concerned || std::any_of(ports.begin(), ports.end(), [&](const std::string& port) {
            const bool gone = !machine.exists(port);
            return gone ? name_of_port(port).starts_with("ttyUSB")
                        : usb_id_of(machine, name_of_port(port)) == adapter.id;
          });
    }
    if (chips.empty()) continue;
    findings.push_back(
        {concerned ? Severity::warning : Severity::note, "serial.brltty", name,
         fmt::format("brltty uses adapters with a {} as braille displays: their port disappears "
                     "a second after you plug the adapter in",
                     chips),
         machine.as_root(fmt::format("ln -s /dev/null /etc/udev/rules.d/{} && udevadm control "
                                     "--reload",
                                     name)),
         Mending::by_hand, ErrorKind::open});
  }
  return findings;
}

}  // namespace r4::tool
