// SPDX-License-Identifier: GPL-3.0-or-later
// A wiring as the value of the setting `wiring`, sent and stored: `1:<two hexadecimal digits for
// each signal>:<CRC-32 of the text before this colon>`. The 1 is the version of the signal list.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../text.hpp"
#include "../vocabulary.hpp"
#include "wiring.hpp"

namespace r4 {

constexpr std::size_t max_wiring_value = 2 + 2 * signal_count + 1 + 8;
R4LINK_API Text write_wiring_value(const Wiring& wiring, char (&out)[max_wiring_value]);
// Refusal::format for another version, a wrong length, or a wrong checksum; ::range for a wiring
// with a fault. `wiring` changes only on Refusal::none.
R4LINK_API Refusal read_wiring_value(Text value, Wiring& wiring);

R4LINK_API std::uint32_t crc_of(const Wiring& wiring);

// The value of the field WIRING in the answer to Q:WIRING: source, in use, wiring: `given,1,1:…`.
constexpr std::size_t max_board_wiring = 10 + max_wiring_value;
R4LINK_API Text write_board_wiring(const BoardWiring& kept, char (&out)[max_board_wiring]);
R4LINK_API bool read_board_wiring(Text text, BoardWiring& kept);

}  // namespace r4
