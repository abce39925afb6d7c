// SPDX-License-Identifier: GPL-3.0-or-later
// Datagrams as a CAN bus carries them: plain, or packed (docs/packed.md).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "../shell/json.hpp"
#include "r4link/datagram.hpp"

namespace r4::tool {

struct PlainForm {
  std::string_view bytes;
  const char* problem = nullptr;  // why the packed datagram cannot be unpacked
};
using UnpackRoom = std::array<char, max_datagram>;

// The plain form of such a datagram, by its first byte. It is in `bytes` or in `room`.
PlainForm plain_form(const std::uint8_t* bytes, std::size_t size, UnpackRoom& room);

// As add_datagram_json(), of a packed datagram; adds `packed`, its size in that form.
bool add_packed_json(Json& object, const std::uint8_t* bytes, std::size_t size);
// The same of a plain or a packed datagram, by its first byte.
bool add_bus_json(Json& object, const std::uint8_t* bytes, std::size_t size);

}  // namespace r4::tool
