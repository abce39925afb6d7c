// SPDX-License-Identifier: GPL-3.0-or-later
// Writes heartbeats, refusals and identification. r4link/messages/message.hpp reads them.
#pragma once

#include <cstdint>

#include "../keys/authentication.hpp"
#include "r4link/datagram.hpp"
#include "r4link/messages/datagram_writer.hpp"
#include "r4link/messages/message.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {

// True if the only command is W.
bool asks_to_watch(const Datagram& datagram);

// `H:R4-ROS2;PNum:…;T:…;`, then as needed `SAFE:n;`, `CAUSE:n;`, `STOP:n;` and `AN:<nonce>;`
Text write_board_heartbeat(char* buffer, std::size_t capacity, std::uint32_t pnum,
                           std::uint32_t t_ms, const SafeReport& safe, Text nonce = Text());
// The reason in heartbeat_report(); none if the field SAFE is missing.
SafeReason heartbeat_reason(const Datagram& datagram);
// Empty if the heartbeat carries no nonce.
Text heartbeat_nonce(const Datagram& datagram);
void write_nack(DatagramWriter& writer, const Nack& nack);

// Words of Identity::capabilities. A board with the word obeys E:LEAVE, W, X, X:UART or X:DAC.
constexpr Text leave_capability("leave");
constexpr Text watch_capability("watch");
constexpr Text i2c_capability("i2c");
constexpr Text uart_capability("uart");
constexpr Text dac_capability("dac");
// True if `word` is in `capabilities`, whose words are separated by '+'.
bool has_capability(Text capabilities, Text word);
void write_identity(DatagramWriter& writer, const Identity& identity);  // the field `I`
void write_identity_fields(DatagramWriter& writer,
                           const Identity& identity);  // the fields after `I`

}  // namespace r4
