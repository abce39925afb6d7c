// SPDX-License-Identifier: GPL-3.0-or-later
// State fields of devices: I2C1 … I2C8, I2CX, I2CBUS, UART1, UART2 (docs/reference/protocol.md).
#pragma once

#include "r4link/messages/datagram_writer.hpp"
#include "r4link/text.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {

// parse_device() returns false for invalid values; `out` may then be partly written.
bool parse_device(Text values, I2cReading& out);
bool parse_device(Text values, I2cAnswer& out);
bool parse_device(Text values, I2cBusReport& out);
bool parse_device(Text values, UartBytes& out);
void write_device(DatagramWriter& writer, const I2cReading& reading);
void write_device(DatagramWriter& writer, const I2cAnswer& answer);
void write_device(DatagramWriter& writer, const I2cBusReport& report);
void write_device(DatagramWriter& writer, const UartBytes& received);

}  // namespace r4
