// SPDX-License-Identifier: GPL-3.0-or-later
// The networks for r4 list, and the boards that have answered there.
#pragma once

#include <cstdint>

#include "transports/udp/search/board_search.hpp"

namespace r4::tool {

// `port`: that was searched.
void print_text(const BoardSearch::Result& found, std::uint16_t port);
void print_json(const BoardSearch::Result& found, std::uint16_t port);

}  // namespace r4::tool
