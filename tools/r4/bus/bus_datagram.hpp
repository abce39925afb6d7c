// SPDX-License-Identifier: GPL-3.0-or-later
// Datagrams on a CAN bus: plain, or packed (docs/reference/packed.md).
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

// The plain form of a datagram; its first byte decides. Refers to `bytes` or `room`.
PlainForm plain_form(const std::uint8_t* bytes, std::size_t size, UnpackRoom& room);

// Like add_datagram_json() for a packed datagram; adds `packed`, its packed size in bytes.
bool add_packed_json(Json& object, const std::uint8_t* bytes, std::size_t size);
bool add_bus_json(Json& object, const std::uint8_t* bytes, std::size_t size);

}  // namespace r4::tool
