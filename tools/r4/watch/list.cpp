// SPDX-License-Identifier: GPL-3.0-or-later
// r4 list: the serial ports, CAN interfaces and networks of this machine, the boards on them, and the URLs
// that r4 knows.
#include <fmt/format.h>

#include <asio/io_context.hpp>
#include <cstdint>
#include <future>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "../shell/help.hpp"
#include "../shell/json.hpp"
#include "../shell/options.hpp"
#include "../shell/subcommands.hpp"
#include "host/standard_registry.hpp"
#include "transports/can/can_interface.hpp"
#include "transports/can/can_listener.hpp"
#include "transports/registry.hpp"
#include "transports/serial/port_list.hpp"
#include "transports/udp/board_search.hpp"

namespace r4::tool {
namespace {

struct Options {
  bool json = false;
  std::uint64_t port = BoardSearch().port;
};

std::string usb_id(const SerialPort& port) {
  return port.vid == 0 ? "" : fmt::format("{:04x}:{:04x}", port.vid, port.pid);
}

// Boards without a host say so twice a second, those with one stream.
constexpr Milliseconds listening{700};

struct CanPort {
  CanInterface interface;
  std::vector<int> boards;
  std::string trouble;  // why nothing could be heard
  std::string fix;
};

std::vector<CanPort> list_can_ports() {
  asio::io_context io(1);
  std::vector<CanPort> ports;
  std::vector<std::unique_ptr<CanListener>> listeners;  // null: cannot be opened
  for (const CanInterface& interface : list_can_interfaces()) {
    CanPort& port = ports.emplace_back();
    port.interface = interface;
    listeners.emplace_back();
    try {
      listeners.back() = std::make_unique<CanListener>(io, interface.name, CanBitRate{1000000, 0});
      listeners.back()->on_event([&ports, i = ports.size() - 1](const CarrierEvent& event) {
        if (event.kind == CarrierEvent::Kind::up) return;
        ports[i].trouble = event.problem.reason;
        ports[i].fix = event.problem.fix;
      });
    } catch (const Error& error) {
      port.trouble = error.problem().reason;
      port.fix = error.problem().fix;
    }
  }
  if (ports.empty()) return ports;
  io.run_for(listening);
  for (std::size_t i = 0; i < ports.size(); ++i) {
    for (std::uint8_t node = 0; listeners[i] && node < can_nodes; ++node) {
      if (listeners[i]->survey().board(node).heard()) ports[i].boards.push_back(node);
    }
  }
  return ports;
}

std::string url_of(const CanPort& port, int node) {
  return fmt::format("can://{}?node={}", port.interface.name, node);
}

void print_json(const std::vector<CanPort>& ports) {
  for (const CanPort& port : ports) {
    Json boards = Json::array();
    for (const int node : port.boards)
      boards.push_back({{"node", node}, {"url", url_of(port, node)}});
    print_line({{"type", "can"},
                {"interface", port.interface.name},
                {"up", port.interface.up},
                {"state", port.interface.state},
                {"bitrate", port.interface.bit_rate},
                {"fd", port.interface.fd},
                {"boards", std::move(boards)},
                {"reason", port.trouble},
                {"fix", port.fix}});
  }
}

void print_can(const std::vector<CanPort>& ports) {
  fmt::print("\nCAN interfaces:\n");
  if (ports.empty()) fmt::print("  none\n");
  for (const CanPort& port : ports) {
    const std::string rate = port.interface.bit_rate == 0
                                 ? (port.interface.has_controller ? "no bit rate" : "virtual")
                                 : fmt::format("{} kbit/s", port.interface.bit_rate / 1000.0);
    fmt::print("  {:<14} {:<5}{:<14} {:<14}{}{}\n", port.interface.name,
               port.interface.up ? "up" : "down", port.interface.state, rate,
               port.interface.fd ? "CAN FD  " : "",
               port.boards.empty() && port.trouble.empty() ? "no board heard" : "");
    for (const int node : port.boards) fmt::print("    R4 board: {}\n", url_of(port, node));
    if (!port.trouble.empty()) {
      fmt::print("    {}{}{}\n", port.trouble, port.fix.empty() ? "" : "; ", port.fix);
    }
  }
}

// --- UDP

using Network = BoardSearch::Network;

constexpr const char* network_fix = "check the network and the firewall";

std::vector<FoundBoard> boards_on(const Network& network, const BoardSearch::Result& found) {
  std::vector<FoundBoard> boards;
  for (const FoundBoard& board : found.boards) {
    if (board.heard_at == network.from) boards.push_back(board);
  }
  return boards;
}

Json board_json(const FoundBoard& board, const BoardSearch::Result& found, std::uint16_t port) {
  Json object{{"address", board.address.to_string()},
              {"board_id", board.board_id},
              {"name", board.name},
              {"firmware", board.firmware},
              {"capabilities", board.capabilities}};
  if (board.busy) object["busy"] = *board.busy;
  object["url"] = url_of(board, found.boards, port);
  return object;
}

void print_json(const BoardSearch::Result& found, std::uint16_t port) {
  for (const Network& network : found.networks) {
    Json boards = Json::array();
    for (const FoundBoard& board : boards_on(network, found)) {
      boards.push_back(board_json(board, found, port));
    }
    print_line({{"type", "udp"},
                {"interface", network.interface},
                {"address", network.from.to_string()},
                {"boards", std::move(boards)},
                {"reason", network.trouble},
                {"fix", network.trouble.empty() ? "" : network_fix}});
  }
}

const char* control_of(const FoundBoard& board) {
  if (!board.busy) return "";
  return *board.busy ? ", controlled by a host" : ", free";
}

void print_udp(const BoardSearch::Result& found, std::uint16_t port) {
  fmt::print("\nNetworks (UDP):\n");
  if (found.networks.empty()) fmt::print("  none\n");
  for (const Network& network : found.networks) {
    const std::vector<FoundBoard> boards = boards_on(network, found);
    fmt::print("  {:<14} {:<19}{}\n", network.interface, network.from.to_string(),
               boards.empty() && network.trouble.empty() ? "no board answered" : "");
    for (const FoundBoard& board : boards) {
      fmt::print("    R4 board: {}  at {}, id {}{}, firmware {}{}\n",
                 url_of(board, found.boards, port), board.address.to_string(), board.board_id,
                 board.name.empty() ? "" : ", name " + board.name, board.firmware,
                 control_of(board));
    }
    if (!network.trouble.empty()) fmt::print("    {}; {}\n", network.trouble, network_fix);
  }
  if (found.more) fmt::print("  more than {} answered\n", BoardSearch::most_boards);
}

// --- serial

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
}

void print_schemes() {
  for (const Registry::Entry& entry : standard_registry().entries()) {
    print_line({{"type", "scheme"},
                {"scheme", entry.scheme},
                {"usage", entry.usage},
                {"meaning", entry.meaning}});
  }
}

int list(const Options& options) {
  BoardSearch search;
  search.port = static_cast<std::uint16_t>(options.port);
  auto answers = std::async(std::launch::async, [&search] { return search.run(); });
  const std::vector<SerialPort> ports = list_serial_ports();
  const std::vector<CanPort> can_ports = list_can_ports();
  const BoardSearch::Result found = answers.get();
  if (options.json) {
    print_json(ports);
    print_json(can_ports);
    print_json(found, search.port);
    print_schemes();
    return 0;
  }
  fmt::print("Serial ports:\n");
  if (ports.empty()) fmt::print("  none\n");
  for (const SerialPort& port : ports) {
    fmt::print("  {:<14} {:<10} {:<24} {}{}\n", port.path, usb_id(port), port.serial_number,
               port.description, port.is_r4 ? fmt::format("  R4 board: {}", url_of(port)) : "");
  }
  print_can(can_ports);
  print_udp(found, search.port);
  fmt::print("\nURLs:\n{}", url_table());
  return 0;
}

constexpr const char* footer =
    R"(An R4 board on USB is found by its id, 2341:0266 (Arduino Giga R1). On CAN interfaces that are up
it listens for 0.7 s, without sending anything, for boards. On networks it asks for boards by IPv4
broadcast, three times within half a second; a board is listed with its name (C:name, over USB) and whether
a host controls it. Broadcast passes no router, and often no VPN, container or WiFi with client isolation:
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
  add_json(*command, options->json, "print JSON, one object a line");
}

}  // namespace r4::tool
