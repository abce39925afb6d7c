// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "../shell/json.hpp"
#include "../shell/options.hpp"
#include "../shell/subcommands.hpp"
#include "can_checks.hpp"
#include "finding.hpp"
#include "link_check.hpp"
#include "machine.hpp"
#include "r4link/can/can_interface.hpp"
#include "r4link/discovery/discover.hpp"
#include "r4link/discovery/url.hpp"
#include "r4link/discovery/url_pattern.hpp"
#include "serial_checks.hpp"
#include "system_checks.hpp"
#include "udev_rules.hpp"

namespace r4::tool {
namespace {

struct Options {
  std::vector<std::string> urls;
  Milliseconds duration{5000};
  bool fix = false;
  bool json = false;
  bool udev_rules = false;
};

void append(Findings& to, Findings more) {
  for (Finding& each : more) to.push_back(std::move(each));
}

std::string device_of(const std::string& path) {
  std::error_code error;
  const std::filesystem::path device = std::filesystem::canonical(path, error);
  return error ? path : device.string();
}

// Process id of the program that holds the port and shares it with its user's programs; 0: none.
int sharing(const Discovery& found, const std::string& device) {
  for (const FoundBoard& board : found.boards) {
    if (board.holder && device_of(board.place) == device) return board.holder->pid;
  }
  return 0;
}

std::vector<std::string> ports_of(const Machine& machine, const Discovery& found, const Url& url) {
  if (url.path().starts_with('/')) return {url.path()};
  std::vector<std::string> ports;
  const std::optional<std::string> serial_number = url.get("sn");
  for (const SearchedPort& port : found.ports) {
    if (serial_number ? port.serial_number == *serial_number : port.is_r4)
      ports.push_back(port.path);
  }
  return ports.empty() ? likely_ports(machine) : ports;
}

Discovery search_ports(const std::vector<Url>& urls) {
  DiscoveryOptions options;
  options.can = options.udp = false;
  for (const Url& url : urls) {
    // A question at the wrong baud rate would be noise.
    const bool named = url.scheme() == "serial" && url.path().starts_with('/') && !url.get("baud");
    if (named) options.serial_ports.push_back(device_of(url.path()));
  }
  return discover(options);
}

Findings check_ports(const Machine& machine, const Discovery& found,
                     std::vector<std::string> ports) {
  std::sort(ports.begin(), ports.end());
  ports.erase(std::unique(ports.begin(), ports.end()), ports.end());
  Findings findings;
  std::vector<std::string> devices;
  for (const std::string& path : ports) {
    const std::string device = devices.emplace_back(device_of(path));
    append(findings, check_port_permission(machine, device));
    append(findings, check_port_holders(machine, device, sharing(found, device)));
    append(findings, check_latency_timer(machine, device));
  }
  append(findings, check_brltty(machine, devices));
  return findings;
}

Findings check_machine(const Machine& machine, const std::vector<Url>& urls) {
  Findings findings;
  std::vector<std::string> ports;
  std::vector<CanInterface> buses;
  const bool serial = urls.empty() || std::any_of(urls.begin(), urls.end(), [](const Url& url) {
                        return url.scheme() == "serial";
                      });
  const Discovery found = serial ? search_ports(urls) : Discovery();
  bool can = urls.empty();
  bool network = urls.empty();
  for (const Url& url : urls) {
    if (url.scheme() == "serial") {
      for (std::string& path : ports_of(machine, found, url)) ports.push_back(std::move(path));
    } else if (url.scheme() == "can") {
      can = true;
      buses.push_back(can_interface(can_interface_of(url)));
    } else if (url.scheme() == "udp") {
      network = true;
    }
  }
  if (urls.empty()) {
    ports = likely_ports(machine);
    buses = list_can_interfaces();
  }
  if (serial) append(findings, check_ports(machine, found, std::move(ports)));
  if (serial) append(findings, check_udev_rules(machine, udev_rules));
  if (can) append(findings, check_can_kernel(machine));
  for (const CanInterface& bus : buses) append(findings, check_can_interface(machine, bus));
  if (network) append(findings, check_network(machine));
  append(findings, check_clock(clock_is_synchronized()));
  append(findings, check_processors(machine));
  return findings;
}

void print(const Findings& findings, bool json) {
  for (const Finding& each : findings) {
    if (json) {
      print_line({{"type", "finding"},
                  {"severity", to_text(each.severity)},
                  {"check", each.check},
                  {"thing", each.thing},
                  {"reason", each.reason},
                  {"fix", each.fix},
                  {"automatic", each.mending == Mending::automatic}});
      continue;
    }
    print_text("{:<8} {}: {}\n", to_text(each.severity), printable(each.thing),
               printable(each.reason));
    if (!each.fix.empty()) print_text("           {}\n", printable(each.fix));
  }
}

int mend(const Findings& findings, bool json) {
  std::vector<std::string> done;
  int mended = 0;
  for (const Finding& each : findings) {
    const bool known = std::find(done.begin(), done.end(), each.fix) != done.end();
    if (each.mending != Mending::automatic || each.severity == Severity::ok || known) continue;
    done.push_back(each.fix);
    if (!json) {
      print_text("{}: {}\n$ {}\n", printable(each.thing), printable(each.reason),
                 printable(each.fix));
    }
    // With --json the output of the command must not mix with the objects on stdout.
    const std::string command = json ? "{ " + each.fix + "; } >&2" : each.fix;
    const bool worked = std::system(from_root(command).c_str()) == 0;
    if (json) {
      print_line(
          {{"type", "mended"}, {"check", each.check}, {"command", each.fix}, {"done", worked}});
    } else if (!worked) {
      print_text("the command failed\n");
    }
    mended += worked ? 1 : 0;
  }
  return mended;
}

// A fix calls r4 by its name, but the folder of r4 may be missing from PATH.
void put_r4_into_the_path() {
  std::error_code error;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  const char* const path = std::getenv("PATH");
  if (!error)
    ::setenv("PATH", (self.parent_path().string() + ":" + (path != nullptr ? path : "")).c_str(),
             1);
}

double wall_clock_ahead_s() {
  const auto wall = std::chrono::system_clock::now().time_since_epoch();
  const auto steady = std::chrono::steady_clock::now().time_since_epoch();
  return std::chrono::duration<double>(wall).count() -
         std::chrono::duration<double>(steady).count();
}

Findings check_links(const Options& options) {
  Findings findings;
  const double before = wall_clock_ahead_s();
  for (HeardLink& link : listen_to_links(options.urls, options.duration)) {
    const LinkSample& sample = link.sample;
    if (options.json) {
      print_line({{"type", "link"},
                  {"url", link.url},
                  {"seconds", sample.seconds},
                  {"received", sample.received},
                  {"states", sample.states},
                  {"lost", sample.lost},
                  {"damaged", sample.damaged},
                  {"jitter_us", sample.jitter_us},
                  {"answer_us", sample.answer_us},
                  {"trouble", to_text(sample.trouble)}});
    }
    append(findings, std::move(link.findings));
  }
  if (!options.urls.empty()) append(findings, check_clock_steps(wall_clock_ahead_s() - before));
  return findings;
}

void print_summary(const Findings& findings, bool json) {
  const auto count = [&](Severity severity) {
    return std::count_if(findings.begin(), findings.end(),
                         [severity](const Finding& each) { return each.severity == severity; });
  };
  const auto errors = count(Severity::error);
  const auto warnings = count(Severity::warning);
  if (json) {
    print_line({{"type", "summary"}, {"errors", errors}, {"warnings", warnings}});
  } else if (errors + warnings == 0) {
    print_text("nothing is wrong\n");
  } else {
    print_text("{} errors, {} warnings\n", errors, warnings);
  }
}

int doctor(const Options& given) {
  Options options = given;
  options.urls = split_paths(join_paths(given.urls));
  if (given.urls.empty()) options.urls.clear();
  if (options.udev_rules) {
    print_text(udev_rules);
    return 0;
  }
  std::vector<Url> urls;
  for (const std::string& url : options.urls) urls.push_back(Url::parse(url));
  const Machine machine = Machine::here();
  put_r4_into_the_path();
  Findings findings = check_machine(machine, urls);
  if (options.fix && mend(findings, options.json) > 0) findings = check_machine(machine, urls);
  append(findings, check_links(options));
  print(findings, options.json);
  print_summary(findings, options.json);
  return exit_code(findings);
}

constexpr const char* footer =
    R"(Without a URL, r4 checks this machine: serial ports and their permissions, udev rules, ModemManager, CAN
interfaces, network, clock and processors. Like r4 list, it asks boards at USB ports for their identity
(Q:ID). With URLs, r4 checks only what their transports need. Then it listens to each board for 5 s as a
watcher, and sends no commands.

The line below a finding shows the command that fixes it. --fix shows and runs the commands that need no
choice, and checks again. It does not kill programs, set bit rates or take interfaces down.

Examples:
  r4 doctor
  r4 doctor serial:auto can://can0?node=1
  r4 doctor udp://192.168.0.125 --duration 30
  r4 doctor --fix
  r4 doctor --udev-rules | sudo tee /etc/udev/rules.d/70-r4.rules

Exit codes: 0 nothing is wrong; 1 there are warnings; 2 usage; or the code of the first error: 3 a board
is silent, or the loss is too high; 4, 5 a transport cannot be opened; 6 an interface is missing.)";

}  // namespace

void add_doctor(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<Options>();
  CLI::App* const command = add_subcommand(
      root, chosen, "doctor", "Find faults of this machine or of a link, and how to fix them",
      footer, options, doctor);
  add_texts(*command, "URL", options->urls, "where boards are, such as serial:auto", url_type);
  add_duration(*command, options->duration, "how long to listen to each link (default 5)");
  add_flag(*command, "--fix", options->fix,
           "run the commands that need no choice, and check again");
  add_flag(*command, "--udev-rules", options->udev_rules,
           "print the udev rules, without any check");
  add_json(*command, options->json, "print JSON, one object a line");
}

}  // namespace r4::tool
