// SPDX-License-Identifier: GPL-3.0-or-later
// r4::discover(): the boards that this computer reaches, with their URLs. `r4 list` prints them.
//
//     const r4::Discovery found = r4::discover();
//     for (const r4::FoundBoard& board : found.boards) fmt::print("{}\n", board.url);
//     r4::Board board(found.only().url);   // or, shorter, r4::Board board = r4::Board::first();
//
// The transports are searched at the same time. Blocks for up to 1.3 s: not for a control loop or
// the loop of an AsyncBoard, which use async_discover().
//
//   serial  A port with the USB id of a board (2341:0266, Arduino Giga R1), and each port of
//           `serial_ports`, is opened as a watcher opens it. The board there is asked who it is
//           (Q:ID), at most three times. A program that wants the port meanwhile gets it. If a
//           program of this computer holds the port, nothing is sent: the search listens beside it.
//   CAN     The search listens on each interface that is up for 0.7 s. A board that is not
//           controlled is asked, at most three times. Nothing is sent to a board that a host
//           controls: the answer to that host's question is heard, within 1.3 s.
//   UDP     Q:ID goes out by IPv4 broadcast on each network of this computer, three times within
//           half a second, from any free port. Broadcast passes no router, and often no VPN,
//           container network or WiFi with client isolation.
//
// The answers are not signed: any program can answer as any board. The link and its keys decide
// what may be commanded. Texts are as received: print them by printable() (error.hpp).
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
  // More serial ports to ask, by path: an adapter, or a simulated board's pty.
  std::vector<std::string> serial_ports = {};
  // The UDP port at which boards listen, 1-65535.
  std::uint16_t udp_port = 2018;
};

struct FoundBoard {
  std::string url;    // opens it: "serial:?sn=…", "can://can0?node=1", "udp:?id=left-arm"
  std::string place;  // SearchedPort::path, SearchedBus::interface or SearchedNetwork::address
  std::string address = {};  // UDP: its IPv4 address
  std::uint8_t node = 0;     // CAN: its number on the bus, 0-31
  // Empty: it did not report its identity.
  std::optional<BoardIdentity> identity = {};
  // True if a host controls it; empty: not known.
  std::optional<bool> busy = {};
  // Serial and CAN: the program here that holds the transport; its name may be empty.
  std::optional<Program> holder = {};
  bool holder_controls = false;  // false: the holder watches
  // CAN: another protocol uses the board's command id, so the board was not asked.
  bool foreign_frames = false;
};

struct SearchedPort {
  std::string path;           // "/dev/ttyACM0"
  std::string url;            // opens the port
  std::string usb_id;         // "2341:0266"; empty: not a USB device
  std::string serial_number;  // of the USB device; may be empty
  std::string description;    // "Giga"; may be empty
  bool is_r4 = false;  // it has the USB id of a board, which is a FoundBoard even if it is silent
  bool asked = false;  // the port was asked, or a program of this computer holds it
  std::optional<Problem> trouble = {};  // why the port could not be asked
};

struct SearchedBus {
  std::string interface;  // "can0"
  bool up = false;
  bool fd = false;                      // takes CAN FD frames
  bool has_controller = false;          // false: virtual, such as vcan
  std::string state;                    // of the controller: "error-active" …; empty: not known
  std::uint32_t bit_rate = 0;           // bit/s; 0: not known
  std::optional<Problem> trouble = {};  // why nothing could be heard
};

struct SearchedNetwork {
  std::string interface;                // "wlan0"
  std::string address;                  // the IPv4 address of this computer in that network
  std::optional<Problem> trouble = {};  // why the question could not be sent
};

struct Discovery {
  static constexpr std::size_t most_answers = 64;

  std::vector<FoundBoard> boards;  // in the order of the places: serial ports, buses, networks
  std::vector<SearchedPort> ports;
  std::vector<SearchedBus> buses;
  std::vector<SearchedNetwork> networks;
  bool more = false;  // more than `most_answers` boards have answered by UDP

  // The only board; one found by several transports, with one board id, is one: its first URL.
  // Throws Error: open for no board, with the places searched; usage for several, with their URLs.
  R4LINK_API FoundBoard only() const;
};

// Without a board the lists are empty. A transport that cannot be searched has a `trouble`. Throws
// Error{usage} for UDP port 0, and std::system_error if the system gives no thread.
R4LINK_API Discovery discover(const DiscoveryOptions& options = {});

}  // namespace r4
