// SPDX-License-Identifier: GPL-3.0-or-later
// CRC-32 as zlib computes it (reflected polynomial 0xEDB88320, initial value and final XOR all
// ones), the datagram's checksum (paper section 4.1).
#pragma once

#include <cstddef>
#include <cstdint>

#include "r4link/text.hpp"

namespace r4 {

// CRC-32 of `bytes`, or of earlier bytes followed by them when `crc` is the earlier bytes' CRC.
// The host computes it with libdeflate where the build has it, the board with a 1 KiB table.
std::uint32_t crc32(Text bytes, std::uint32_t crc = 0);

// The table form, always there: the board's, and the reference in tests.
std::uint32_t crc32_table(Text bytes, std::uint32_t crc = 0);

}  // namespace r4
