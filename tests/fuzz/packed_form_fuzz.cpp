// SPDX-License-Identifier: GPL-3.0-or-later
// Any bytes, as a packed datagram: they are refused, or they unpack to a text of the grammar. Any
// bytes, as a datagram or as fields with a checksum: they are sent as text, or they unpack
// unchanged after packing.
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>

#include "protocol/datagram/crc32.hpp"
#include "protocol/datagram/numbers.hpp"
#include "r4link/datagram.hpp"
#include "r4link/messages/packed_form.hpp"

namespace r4 {
namespace {

void require(bool holds) {
  if (!holds) std::abort();
}

void comes_back(Text datagram) {
  std::uint8_t bytes[max_datagram];
  const std::size_t size = pack(datagram, bytes, sizeof bytes);
  if (size == 0) return;
  require(size < datagram.size() && is_packed(bytes[0]));
  // `exact` has exactly this size on the heap, so a sanitizer finds an access beyond the buffer.
  const std::string exact(reinterpret_cast<const char*>(bytes), size);
  std::string out(datagram.size(), '\0');
  const UnpackResult result =
      unpack(reinterpret_cast<const std::uint8_t*>(exact.data()), size, out.data(), out.size());
  require(result && Text(out.data(), result.size) == datagram);
}

void unpacks_safely(const std::uint8_t* data, std::size_t size) {
  char out[max_datagram];
  const UnpackResult result = unpack(data, size, out, sizeof out);
  require(static_cast<bool>(result) == (result.size != 0) && result.size <= sizeof out);
  if (!result) return;
  Datagram datagram;
  const ReadResult read_result = read_datagram(Text(out, result.size), datagram);
  require(read_result.error != ReadError::length);
  comes_back(Text(out, result.size));
}

void fields_come_back(const std::uint8_t* data, std::size_t size) {
  std::string text(reinterpret_cast<const char*>(data), size);
  text += '^';
  char hex[max_number_text];
  const char* const end = write_hex(hex, crc32(text));
  text += "0x" + std::string(hex, static_cast<std::size_t>(end - hex)) + '^';
  Datagram datagram;
  if (read_datagram(text, datagram)) comes_back(text);
}

}  // namespace
}  // namespace r4

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  r4::unpacks_safely(data, size);
  r4::comes_back(r4::Text(reinterpret_cast<const char*>(data), size));
  r4::fields_come_back(data, size);
  return 0;
}
