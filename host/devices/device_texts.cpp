// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "../../protocol/datagram/numbers.hpp"
#include "r4link/devices/device.hpp"
#include "r4link/error.hpp"

namespace r4 {

namespace {

struct DevicePlace {  // NAME[@ADDRESS[:SLOT]]
  std::string name;
  std::optional<int> address;
  std::optional<int> slot;
};

std::optional<int> small_number(std::string_view word) {
  std::uint32_t value = 0;
  const bool read = word.starts_with("0x") ? parse_hex(Text(word.substr(2)), value)
                                           : parse_number(Text(word), value);
  constexpr std::uint32_t most = 1000;
  if (!read || value > most) return std::nullopt;
  return static_cast<int>(value);
}

DevicePlace read_place(std::string_view text) {
  const std::size_t at = std::min(text.rfind('@'), text.size());
  DevicePlace place;
  place.name = text.substr(0, at);
  if (at == text.size()) return place;
  const std::string_view where = text.substr(at + 1);
  const std::size_t colon = std::min(where.find(':'), where.size());
  place.address = small_number(where.substr(0, colon));
  if (colon != where.size()) place.slot = small_number(where.substr(colon + 1));
  if (!place.address || (colon != where.size() && !place.slot)) {
    throw Error(ErrorKind::usage, std::string(text), "the address or slot is not a number",
                "write NAME@ADDRESS or NAME@ADDRESS:SLOT, such as bno055@0x28:1");
  }
  return place;
}

}  // namespace

Device Device::from(std::string_view text, int first_slot) {
  const DevicePlace place = read_place(text);
  DeviceDescription description = DeviceDescription::load(place.name);
  const int usual = description.addresses.front();
  return {std::move(description), place.address.value_or(usual), place.slot.value_or(first_slot)};
}

Device Device::parse(std::string_view place, std::string_view description) {
  const DevicePlace where = read_place(place);
  DeviceDescription read = DeviceDescription::parse(description, std::string(place));
  const int usual = read.addresses.front();
  return {std::move(read), where.address.value_or(usual), where.slot.value_or(1)};
}

std::vector<Device> Device::from(const std::vector<std::string>& texts) {
  std::vector<Device> devices;
  int next = 1;
  for (const std::string& text : texts) {
    devices.push_back(from(text, next));
    const Device& newest = devices.back();
    next = newest.last_slot() + 1;
    for (std::size_t i = 0; i + 1 < devices.size(); ++i) {
      const Device& other = devices[i];
      if (!newest.takes_place_of(other)) continue;
      if (newest.address() == other.address()) {
        throw Error(ErrorKind::usage, newest.text(), other.text() + " has the same address",
                    "give one device another address: NAME@ADDRESS");
      }
      throw Error(ErrorKind::usage, newest.text(),
                  fmt::format("{} also has slot {}", other.text(),
                              std::max(newest.first_slot(), other.first_slot())),
                  "give one device another slot: NAME@ADDRESS:SLOT");
    }
  }
  return devices;
}

}  // namespace r4
