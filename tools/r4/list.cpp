// SPDX-License-Identifier: GPL-3.0-or-later
// r4 list: the serial ports of this machine, and the URLs that r4 knows.
#include <fmt/format.h>

#include <memory>
#include <string>
#include <vector>

#include "help.hpp"
#include "host/async_board.hpp"
#include "json.hpp"
#include "options.hpp"
#include "subcommands.hpp"
#include "transports/port_list.hpp"
#include "transports/registry.hpp"

namespace r4::tool {
namespace {

struct Options {
  bool json = false;
};

std::string usb_id(const SerialPort& port) {
  return port.vid == 0 ? "" : fmt::format("{:04x}:{:04x}", port.vid, port.pid);
}

void print_json(const std::vector<SerialPort>& ports) {
  for (const SerialPort& port : ports) {
    print_line({{"type", "port"},
                {"path", port.path},
                {"usb", usb_id(port)},
                {"serial_number", port.serial_number},
                {"description", port.description},
                {"r4", port.is_r4},
                {"url", url_of(port)}});
  }
  for (const Registry::Entry& entry : standard_registry().entries()) {
    print_line({{"type", "scheme"},
                {"scheme", entry.scheme},
                {"usage", entry.usage},
                {"meaning", entry.meaning}});
  }
}

int list(const Options& options) {
  const std::vector<SerialPort> ports = list_serial_ports();
  if (options.json) {
    print_json(ports);
    return 0;
  }
  fmt::print("Serial ports:\n");
  if (ports.empty()) fmt::print("  none\n");
  for (const SerialPort& port : ports) {
    fmt::print("  {:<14} {:<10} {:<24} {}{}\n", port.path, usb_id(port), port.serial_number,
               port.description, port.is_r4 ? fmt::format("  R4 board: {}", url_of(port)) : "");
  }
  fmt::print("\nURLs:\n{}", url_table());
  return 0;
}

constexpr const char* footer =
    R"(An R4 board on USB is found by its id, 2341:0266 (Arduino Giga R1).

Exit codes: 0 done, also when there are no ports.)";

}  // namespace

void add_list(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<Options>();
  CLI::App* const command =
      add_subcommand(root, chosen, "list", "List serial ports and which of them is an R4 board",
                     footer, options, list);
  add_json(*command, options->json, "print JSON, one object a line");
}

}  // namespace r4::tool
