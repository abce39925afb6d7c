// SPDX-License-Identifier: GPL-3.0-or-later
// r4 list: the serial ports, CAN interfaces and networks of this machine, the boards on them, and the URLs
// that r4 knows.
#include <fmt/format.h>

#include <cstdint>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include "../shell/help.hpp"
#include "../shell/json.hpp"
#include "../shell/options.hpp"
#include "../shell/subcommands.hpp"
#include "host/standard_registry.hpp"
#include "list_can.hpp"
#include "list_serial.hpp"
#include "list_udp.hpp"
#include "transports/registry.hpp"

namespace r4::tool {
namespace {

struct Options {
  bool json = false;
  std::uint64_t port = BoardSearch().port;
  std::vector<std::string> serial;
};

void print_schemes() {
  for (const Registry::Entry& entry : standard_registry().entries()) {
    print_line({{"type", "scheme"},
                {"scheme", entry.scheme},
                {"usage", entry.usage},
                {"meaning", entry.meaning}});
  }
}

// All at once: each waits for answers.
int list(const Options& options) {
  BoardSearch search;
  search.port = static_cast<std::uint16_t>(options.port);
  auto answers = std::async(std::launch::async, [&search] { return search.run(); });
  auto asked = std::async(std::launch::async, [&options] { return list_ports(options.serial); });
  const std::vector<ListedBus> buses = list_buses();
  const std::vector<ListedPort> ports = asked.get();
  const BoardSearch::Result found = answers.get();
  if (options.json) {
    print_json(ports);
    print_json(buses);
    print_json(found, search.port);
    print_schemes();
    return 0;
  }
  print_text(ports);
  print_text(buses);
  print_text(found, search.port);
  fmt::print("\nURLs:\n{}", url_table());
  return 0;
}

constexpr const char* footer =
    R"(Each board is listed with the URL to use, its id, its name (C:name, over USB), its firmware, and
whether a host controls it: with name and pid where that is a program of this machine, which is not
disturbed.

On USB a board is known by its id, 2341:0266 (Arduino Giga R1), and asked who it is; --serial asks at
a port that has another id: an adapter's, or the pty of a simulated board. On CAN interfaces that are
up it listens for 0.7 s, and asks who has no host. On networks it asks by IPv4 broadcast, three
times within half a second. Who has a host is heard when that one asks: all takes 1.3 s at most.

Broadcast passes no router, and often no VPN, container or WiFi with client isolation:
there give the board's address, as in udp://192.168.1.77. A firewall must let in UDP from port 2018.

With --json one object a line: {"type":"port"…} of a serial port, {"type":"can"…} of a CAN interface,
{"type":"udp"…} of a network, with their boards, {"type":"scheme"…} of a transport.

Exit codes: 0 done, also when there are none.)";

}  // namespace

void add_list(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<Options>();
  CLI::App* const command =
      add_subcommand(root, chosen, "list",
                     "List serial ports, CAN interfaces and networks, and the boards on them",
                     footer, options, list);
  add_number(*command, "--port", options->port, 1, 65535,
             "the UDP port at which boards listen (default 2018)");
  add_repeated(*command, "--serial", options->serial,
               "ask at this serial port, too, whatever its USB id; may be repeated", file_type);
  add_json(*command, options->json, "print JSON, one object a line");
}

}  // namespace r4::tool
