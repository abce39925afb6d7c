// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <string>

#include "../shell/json.hpp"
#include "../shell/options.hpp"
#include "../shell/subcommands.hpp"
#include "r4link/devices/description.hpp"
#include "r4link/error.hpp"

namespace r4::tool {
namespace {

struct Options {
  std::string device;
  bool json = false;
};

std::string addresses_of(const DeviceDescription& device) {
  const std::vector<int>& all = device.addresses;
  const auto gap =
      std::adjacent_find(all.begin(), all.end(), [](int one, int next) { return next != one + 1; });
  if (all.size() > 2 && gap == all.end()) {
    return fmt::format("0x{:02x}-0x{:02x}", all.front(), all.back());
  }
  return fmt::format("0x{:02x}", fmt::join(all, ", 0x"));
}

Json json_of(const DeviceDescription& device) {
  Json values = Json::object();
  for (const DeviceValue& value : device.values) values[value.name] = value.unit;
  Json ready = Json::object();
  for (const DeviceReady& each : device.ready) {
    ready[device.values[each.value].name] = each.number ? Json(*each.number) : Json();
  }
  return {{"name", device.name},          {"title", device.title},
          {"role", to_text(device.role)}, {"addresses", device.addresses},
          {"slots", device.polls.size()}, {"values", std::move(values)},
          {"ready", std::move(ready)}};
}

void print_values(const DeviceDescription& device) {
  print_text("{}: {}\n", device.name, device.title);
  print_text("  role {}, at {}, {} of 8 slots\n", to_text(device.role), addresses_of(device),
             device.polls.size());
  for (const DeviceValue& value : device.values) {
    const DevicePoll& poll = device.polls[value.poll];
    print_text("  {:<16} {:<8} every {} ms\n", value.name, value.unit.empty() ? "-" : value.unit,
               poll.period.count());
  }
  for (const DeviceReady& each : device.ready) {
    const std::string& name = device.values[each.value].name;
    print_text("  the device is set up while {} is {}\n", name,
               each.number ? fmt::format("{}", *each.number) : "a measurement");
  }
  if (device.ready.empty() && !device.writes.empty()) {
    print_text(
        "  after a reset its values look like measurements: to detect this, add a line: ready "
        "VALUE NUMBER\n");
  }
}

int devices(const Options& options) {
  if (!options.device.empty()) {
    const DeviceDescription device = DeviceDescription::load(options.device);
    options.json ? print_line(json_of(device)) : print_values(device);
    return 0;
  }
  for (const std::string& name : DeviceDescription::shipped()) {
    const DeviceDescription device = DeviceDescription::load(name);
    if (options.json) {
      print_line(json_of(device));
    } else {
      print_text("{:<10} {:<6} {:<11} {}\n", name, to_text(device.role), addresses_of(device),
                 device.title);
    }
  }
  return 0;
}

constexpr const char* footer =
    R"(Without NAME, r4 lists the descriptions that are installed with r4. With a name, or with the path of your
own file, r4 shows the role, the addresses, and the values with their units. If a file is wrong, r4 reports
the line. --device of r4 monitor and r4 convert takes such a name or path, with an address.

Examples:
  r4 devices
  r4 devices bno055
  r4 devices ./mine.device             checks your own file

Exit codes: 0 done; 1 the description is wrong; 2 the name is not known; 4, 5 the file cannot be read.)";

}  // namespace

void add_devices(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<Options>();
  CLI::App* const command = add_subcommand(root, chosen, "devices", "List the described sensors",
                                           footer, options, devices);
  add_text(*command, "NAME", options->device, "the name of a description, or a file", file_type);
  add_json(*command, options->json, "print JSON, one object a line");
}

}  // namespace r4::tool
