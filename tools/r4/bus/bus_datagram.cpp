// SPDX-License-Identifier: GPL-3.0-or-later
#include "bus_datagram.hpp"

#include <fmt/format.h>

#include "r4link/messages/packed_form.hpp"

namespace r4::tool {
namespace {

bool may_be_packed(const std::uint8_t* bytes, std::size_t size) {
  return size != 0 && is_packed(bytes[0]);
}

std::string_view characters(const std::uint8_t* bytes, std::size_t size) {
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): bytes as characters
  return {reinterpret_cast<const char*>(bytes), size};
}

PlainForm unpacked(const std::uint8_t* bytes, std::size_t size, UnpackRoom& room) {
  const UnpackResult result = unpack(bytes, size, room.data(), room.size());
  return {{room.data(), result.size}, result ? nullptr : to_text(result.error)};
}

}  // namespace

PlainForm plain_form(const std::uint8_t* bytes, std::size_t size, UnpackRoom& room) {
  if (may_be_packed(bytes, size)) return unpacked(bytes, size, room);
  return {characters(bytes, size)};
}

bool add_packed_json(Json& object, const std::uint8_t* bytes, std::size_t size) {
  UnpackRoom room;
  const PlainForm plain = unpacked(bytes, size, room);
  object["ok"] = false;
  if (plain.problem != nullptr) {
    object["error"] = "packed";
    object["reason"] = plain.problem;
    object["text"] = fmt::format("packed:{:02x}", fmt::join(bytes, bytes + size, ""));
    return false;
  }
  object["packed"] = size;
  return add_datagram_json(object, plain.bytes);
}

bool add_bus_json(Json& object, const std::uint8_t* bytes, std::size_t size) {
  return may_be_packed(bytes, size) ? add_packed_json(object, bytes, size)
                                    : add_datagram_json(object, characters(bytes, size));
}

}  // namespace r4::tool
