// SPDX-License-Identifier: GPL-3.0-or-later
// What kind of message a datagram is, and the small ones that are neither state nor command:
// heartbeats, refusals and identification.
#pragma once

#include <cstdint>

#include "authentication.hpp"
#include "datagram.hpp"
#include "datagram_writer.hpp"
#include "refusal.hpp"
#include "units.hpp"

namespace r4 {

enum class MessageKind : std::uint8_t {
  board_heartbeat,  // H:R4-ROS2
  host_heartbeat,   // H:ROS2-R4
  command,          // one of command.hpp's letters
  nack,             // N:<PNum>,<code>
  identity,         // I:R4,<firmware>,<board id>,<capabilities>
  state,            // anything else
};

// "heartbeat" (both sides'), "command", "nack", "identity", "state": the `type` of `r4 decode`.
const char* to_text(MessageKind kind);

MessageKind kind_of(const Datagram& datagram);

// The board's heartbeat: `H:R4-ROS2;PNum:…;T:…;`, with `SAFE:n;` behind the T while n is not 0, and
// `AN:<nonce>;` behind that unless there is none (authentication.hpp).
Text write_board_heartbeat(char* buffer, std::size_t capacity, std::uint32_t pnum,
                           std::uint32_t t_ms, SafeReason safe, Text nonce = Text());
// The reason that a board heartbeat carries; none if it carries no SAFE. One that cannot be read is
// taken for a fault.
SafeReason heartbeat_reason(const Datagram& datagram);
// The nonce that it carries; empty if it carries none.
Text heartbeat_nonce(const Datagram& datagram);
// Does it say that the board waits for a host, in CONNECTING? Its PNum is 0 then, and its T too,
// unless it carries a nonce.
bool is_connecting_heartbeat(const Datagram& datagram);

// A refusal: which command of ours, and why. False if the datagram's N field is not of that form.
struct Nack {
  std::uint32_t pnum = 0;
  Refusal code = Refusal::none;
};
bool read_nack(const Datagram& datagram, Nack& out);
void write_nack(DatagramWriter& writer, const Nack& nack);

// Who the board is; views of the datagram.
struct Identity {
  Text firmware;      // "0.1.0"
  Text board_id;      // serial number, unique
  Text capabilities;  // words joined by '+': "udp+serial"
};
bool read_identity(const Datagram& datagram, Identity& out);
void write_identity(DatagramWriter& writer, const Identity& identity);

}  // namespace r4
