// SPDX-License-Identifier: GPL-3.0-or-later
// CRC-32 (paper section 4.1) as in zlib: reflected 0xEDB88320; initial value, final XOR: all ones.
#pragma once

#include <cstddef>
#include <cstdint>

#include "r4link/text.hpp"

namespace r4 {

// `crc`: CRC of the preceding bytes. Host: libdeflate if available; board: a 1 KiB table.
std::uint32_t crc32(Text bytes, std::uint32_t crc = 0);

// The form with a table, for the board. Tests compare crc32() with crc32_table().
std::uint32_t crc32_table(Text bytes, std::uint32_t crc = 0);

}  // namespace r4
