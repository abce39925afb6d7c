// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "../shell/help.hpp"
#include "../shell/json.hpp"
#include "../shell/options.hpp"
#include "../shell/subcommands.hpp"
#include "r4link/discovery/discover.hpp"

namespace r4::tool {
namespace {

struct Options {
  bool json = false;
  std::uint64_t port = DiscoveryOptions().udp_port;
  std::vector<std::string> serial;
};

std::vector<FoundBoard> boards_at(const Discovery& all, const std::string& place) {
  std::vector<FoundBoard> boards;
  for (const FoundBoard& board : all.boards) {
    if (board.place == place) boards.push_back(board);
  }
  return boards;
}

std::string text_of(const FoundBoard& board) {
  std::string text = "it does not report its identity";
  if (board.identity) {
    text = fmt::format("id {}{}, firmware {}", board.identity->board_id,
                       board.identity->name.empty() ? "" : ", name " + board.identity->name,
                       board.identity->firmware);
  }
  if (board.busy && !board.holder_controls) {
    text += *board.busy ? ", controlled by a host" : ", free";
  }
  if (board.foreign_frames) {
    text += fmt::format(
        ", and its ids have frames that are damaged or not R4's, perhaps of another device; look "
        "at "
        "r4 bus can://{}",
        board.place);
  }
  if (const std::optional<Program>& holder = board.holder) {
    text +=
        holder->name.empty()
            ? fmt::format(", held by a program (pid {}) that does not answer", holder->pid)
            : fmt::format(", {} by {} (pid {})", board.holder_controls ? "controlled" : "watched",
                          holder->name, holder->pid);
  }
  return printable(text);
}

void print_board(const FoundBoard& board) {
  print_text("    R4 board: {}  {}{}\n", printable(board.url),
             board.address.empty() ? "" : fmt::format("at {}, ", board.address), text_of(board));
}

void print_trouble_of(const std::optional<Problem>& trouble) {
  if (!trouble) return;
  print_text("    {}{}{}\n", printable(trouble->reason), trouble->fix.empty() ? "" : "; ",
             printable(trouble->fix));
}

void print_ports(const Discovery& all) {
  print_text("Serial ports:\n");
  if (all.ports.empty()) print_text("  none\n");
  for (const SearchedPort& port : all.ports) {
    print_text("  {:<14} {:<10} {:<24} {}\n", printable(port.path), port.usb_id,
               printable(port.serial_number), printable(port.description));
    const std::vector<FoundBoard> boards = boards_at(all, port.path);
    for (const FoundBoard& board : boards) print_board(board);
    if (port.asked && boards.empty()) {
      print_text("    no R4 board answered at {}\n", printable(port.url));
    }
    print_trouble_of(port.trouble);
  }
}

void print_buses(const Discovery& all) {
  print_text("\nCAN interfaces:\n");
  if (all.buses.empty()) print_text("  none\n");
  for (const SearchedBus& bus : all.buses) {
    const std::vector<FoundBoard> boards = boards_at(all, bus.interface);
    const std::string rate = bus.bit_rate == 0 ? (bus.has_controller ? "no bit rate" : "virtual")
                                               : fmt::format("{} kbit/s", bus.bit_rate / 1000.0);
    print_text("  {:<14} {:<5}{:<14} {:<14}{}{}\n", printable(bus.interface),
               bus.up ? "up" : "down", bus.state, rate, bus.fd ? "CAN FD  " : "",
               boards.empty() && !bus.trouble ? "no board found" : "");
    for (const FoundBoard& board : boards) print_board(board);
    print_trouble_of(bus.trouble);
  }
}

void print_networks(const Discovery& all) {
  print_text("\nNetworks (UDP):\n");
  if (all.networks.empty()) print_text("  none\n");
  for (const SearchedNetwork& network : all.networks) {
    const std::vector<FoundBoard> boards = boards_at(all, network.address);
    print_text("  {:<14} {:<19}{}\n", printable(network.interface), network.address,
               boards.empty() && !network.trouble ? "no board answered" : "");
    for (const FoundBoard& board : boards) print_board(board);
    print_trouble_of(network.trouble);
  }
  if (all.more) print_text("  more than {} boards answered\n", Discovery::most_answers);
}

void describe(const FoundBoard& board, Json& object) {
  if (board.identity) {
    object.update({{"board_id", board.identity->board_id},
                   {"name", board.identity->name},
                   {"firmware", board.identity->firmware},
                   {"capabilities", board.identity->capabilities}});
  }
  if (board.busy) object["busy"] = *board.busy;
  if (board.foreign_frames) object["foreign_frames"] = true;
  if (!board.holder) return;
  object["held_by"] = {{"program", board.holder->name},
                       {"pid", board.holder->pid},
                       {"controls", board.holder_controls}};
}

void print_json(const Discovery& all) {
  for (const SearchedPort& port : all.ports) {
    Json object{{"type", "port"},
                {"path", port.path},
                {"usb", port.usb_id},
                {"serial_number", port.serial_number},
                {"description", port.description},
                {"r4", port.is_r4},
                {"url", port.url}};
    for (const FoundBoard& board : boards_at(all, port.path)) describe(board, object);
    if (port.trouble) {
      object.update({{"reason", port.trouble->reason}, {"fix", port.trouble->fix}});
    }
    print_line(object);
  }
  for (const SearchedBus& bus : all.buses) {
    Json boards = Json::array();
    for (const FoundBoard& board : boards_at(all, bus.interface)) {
      Json object{{"node", board.node}, {"url", board.url}};
      describe(board, object);
      boards.push_back(std::move(object));
    }
    const Problem trouble = bus.trouble.value_or(Problem());
    print_line({{"type", "can"},
                {"interface", bus.interface},
                {"up", bus.up},
                {"state", bus.state},
                {"bitrate", bus.bit_rate},
                {"fd", bus.fd},
                {"boards", std::move(boards)},
                {"reason", trouble.reason},
                {"fix", trouble.fix}});
  }
  for (const SearchedNetwork& network : all.networks) {
    Json boards = Json::array();
    for (const FoundBoard& board : boards_at(all, network.address)) {
      Json object{{"address", board.address}};
      describe(board, object);
      object["url"] = board.url;
      boards.push_back(std::move(object));
    }
    const Problem trouble = network.trouble.value_or(Problem());
    print_line({{"type", "udp"},
                {"interface", network.interface},
                {"address", network.address},
                {"boards", std::move(boards)},
                {"reason", trouble.reason},
                {"fix", trouble.fix}});
  }
}

int list(const Options& options) {
  DiscoveryOptions where;
  where.serial_ports = options.serial;
  where.udp_port = static_cast<std::uint16_t>(options.port);
  const Discovery found = discover(where);
  if (options.json) {
    print_json(found);
    print_url_schemes();
    return 0;
  }
  print_ports(found);
  print_buses(found);
  print_networks(found);
  print_text("\nURLs:\n{}", url_table());
  return 0;
}

constexpr const char* footer =
    R"(For each board, r4 lists the URL to use, the id, the name (C:name, over USB), the firmware, and whether a
host controls the board. If the host is a program of this machine, r4 also lists its name and pid. The
search does not disturb that program.

On USB, r4 recognizes a board by its USB id, 2341:0266 (Arduino Giga R1), and asks for its identity.
--serial also asks at a port with another USB id: an adapter, or the pty of a simulated board. On CAN
interfaces that are up, r4 listens for 0.7 s, and asks the boards that no host controls. On networks,
r4 asks by IPv4 broadcast, three times within half a second. r4 hears a controlled board when its host
asks the board. The search takes at most 1.3 s.

A broadcast does not pass routers, and often does not pass VPNs, containers or WiFi with client isolation.
There, give the board's address, as in udp://192.168.1.77. A firewall must let in UDP from port 2018.

With --json, r4 prints one object a line: {"type":"port"…} for a serial port, {"type":"can"…} for a CAN
interface, {"type":"udp"…} for a network, each with its boards, and {"type":"scheme"…} for a transport.

Exit codes: 0 done, even without any board.)";

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
               "also ask at this serial port, with any USB id; may be repeated", file_type);
  add_json(*command, options->json, "print JSON, one object a line");
}

}  // namespace r4::tool
