// SPDX-License-Identifier: GPL-3.0-or-later
// Writes the small messages that are neither state nor command: heartbeats, refusals and
// identification. Reads heartbeats; r4link/messages/message.hpp reads the other two.
#pragma once

#include <cstdint>

#include "../keys/authentication.hpp"
#include "r4link/datagram.hpp"
#include "r4link/messages/datagram_writer.hpp"
#include "r4link/messages/message.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {

// Is it a single command, W?
bool asks_to_watch(const Datagram& datagram);

// The board's heartbeat: `H:R4-ROS2;PNum:…;T:…;`, and behind the T what there is of `SAFE:n;`,
// `CAUSE:n;`, `STOP:n;` and `AN:<nonce>;` (authentication.hpp).
Text write_board_heartbeat(char* buffer, std::size_t capacity, std::uint32_t pnum,
                           std::uint32_t t_ms, const SafeReport& safe, Text nonce = Text());
// The reason alone of heartbeat_report(); none if there is no SAFE.
SafeReason heartbeat_reason(const Datagram& datagram);
// The nonce that it carries; empty if it carries none.
Text heartbeat_nonce(const Datagram& datagram);
void write_nack(DatagramWriter& writer, const Nack& nack);

// What the firmware can do besides, whatever the board: it obeys E:LEAVE, and serves who watches by W.
constexpr Text leave_capability("leave");
constexpr Text watch_capability("watch");
// It has an I2C bus for the user: X.
constexpr Text i2c_capability("i2c");
// UARTs: X:UART. A DAC and spare inputs: X:DAC, GPIO.
constexpr Text uart_capability("uart");
constexpr Text dac_capability("dac");
// Is it one of those words?
bool has_capability(Text capabilities, Text word);
void write_identity(DatagramWriter& writer, const Identity& identity);  // its `I`
void write_identity_fields(DatagramWriter& writer,
                           const Identity& identity);  // and what is behind it

}  // namespace r4
