// SPDX-License-Identifier: GPL-3.0-or-later
// r4::discover(): the boards that this computer reaches, with their URLs. `r4 list` prints them.
//     const r4::Discovery found = r4::discover();
//     for (const r4::FoundBoard& board : found.boards) fmt::print("{}\n", board.url);
//     r4::Board board(found.only().url);   // or, shorter, r4::Board board = r4::Board::first();
//
// The transports are searched at the same time. Blocks for up to 1.3 s. In a control loop or the
// loop of an AsyncBoard, use async_discover().
//   serial  A port with the USB id of a board (2341:0266, Arduino Giga R1), and each port of
//           `serial_ports`, is opened as by a watcher. The search requests the board's identity
//           (Q:ID), at most three times. A program that opens the port meanwhile gets the port. If
//           a program of this computer holds the port, the search only listens beside it.
//   CAN     The search listens on each interface that is up for 0.7 s. A board that is not
//           controlled gets Q:ID, at most three times. Nothing is sent to a board that a host
//           controls: the search receives the answer to the host's question within 1.3 s.
//   UDP     Q:ID goes out by IPv4 broadcast on each network of this computer, three times within
//           half a second, from any free port. Broadcast passes no router, and often no VPN,
//           container network or WiFi with client isolation.
//
// The answers are not signed: any program can answer as any board. The link and its keys decide
// which commands are obeyed. Texts are as received: print them with printable() (error.hpp).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "../config.hpp"
#include "../error.hpp"
#include "../link.hpp"

namespace r4 {

struct DiscoveryOptions {
  bool serial = true;
  bool can = true;
  bool udp = true;
  // Paths of further serial ports to search: an adapter, or a simulated board's pty.
  std::vector<std::string> serial_ports = {};
  // The UDP port at which boards listen, 1-65535.
  std::uint16_t udp_port = 2018;
};

struct FoundBoard {
  std::string url;    // "serial:?sn=…", "can://can0?node=1", "udp:?id=left-arm"
  std::string place;  // SearchedPort::path, SearchedBus::interface or SearchedNetwork::address
  std::string address = {};  // UDP: IPv4 address
  std::uint8_t node = 0;     // CAN: number on the bus, 0-31
  std::optional<BoardIdentity> identity = {};
  // True if a host controls the board; empty: not known.
  std::optional<bool> busy = {};
  // Serial and CAN: the program of this computer that holds the transport; its name may be empty.
  std::optional<Program> holder = {};
  bool holder_controls = false;  // false: the holder watches
  // CAN: the board's ids have frames that are damaged or not R4's, perhaps of another device.
  bool foreign_frames = false;
};

struct SearchedPort {
  std::string path;           // "/dev/ttyACM0"
  std::string url;            // URL to open the port
  std::string usb_id;         // "2341:0266"; empty: not a USB device
  std::string serial_number;  // of the USB device; may be empty
  std::string description;    // "Giga"; may be empty
  bool is_r4 = false;         // has a board's USB id: listed as a FoundBoard even if silent
  bool asked = false;         // Q:ID was sent, or a program of this computer holds the port
  std::optional<Problem> trouble = {};  // why Q:ID could not be sent
};

struct SearchedBus {
  std::string interface;  // "can0"
  bool up = false;
  bool fd = false;                      // accepts CAN FD frames
  bool has_controller = false;          // false: virtual, such as vcan
  std::string state;                    // of the controller: "error-active" …; empty: not known
  std::uint32_t bit_rate = 0;           // bit/s; 0: not known
  std::optional<Problem> trouble = {};  // why the search could not listen
};

struct SearchedNetwork {
  std::string interface;                // "wlan0"
  std::string address;                  // this computer's IPv4 address in the network
  std::optional<Problem> trouble = {};  // why Q:ID could not be sent
};

struct Discovery {
  static constexpr std::size_t most_answers = 64;

  std::vector<FoundBoard> boards;  // in this order: serial ports, buses, networks
  std::vector<SearchedPort> ports;
  std::vector<SearchedBus> buses;
  std::vector<SearchedNetwork> networks;
  bool more = false;  // more than `most_answers` boards have answered by UDP

  // The only board. A board id on several transports is one board, with its first URL. If no board
  // was found, throws Error{open} with the searched places. If several boards were found, throws
  // Error{usage} with all URLs.
  R4LINK_API FoundBoard only() const;
};

// A transport that cannot be searched has a `trouble`. Throws Error{usage} for UDP port 0, and
// std::system_error if the system has no thread.
R4LINK_API Discovery discover(const DiscoveryOptions& options = {});

}  // namespace r4
