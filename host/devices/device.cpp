// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/devices/device.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "../../protocol/datagram/numbers.hpp"
#include "r4link/error.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {

namespace {

// Of "NAME[@ADDRESS[:SLOT]]".
struct DevicePlace {
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
    throw Error(ErrorKind::usage, std::string(text), "its address or slot is no number",
                "write NAME@ADDRESS or NAME@ADDRESS:SLOT, such as bno055@0x28:1");
  }
  return place;
}

}  // namespace

Device::Device(DeviceDescription description, int address, int first_slot)
    : description_(std::move(description)), address_(address), first_slot_(first_slot) {
  const std::vector<int>& possible = description_.addresses;
  if (std::find(possible.begin(), possible.end(), address) == possible.end()) {
    throw Error(ErrorKind::usage, text(), "it cannot have that address",
                fmt::format("by its description it is 0x{:02x}", fmt::join(possible, ", 0x")));
  }
  if (first_slot < 1 || last_slot() > i2c_slots) {
    throw Error(ErrorKind::usage, text(),
                fmt::format("it takes {} slots from slot {} on, and the board has {}",
                            description_.polls.size(), first_slot, i2c_slots),
                "begin at a lower slot, or read fewer devices");
  }
}

Device Device::from(std::string_view text, int first_slot) {
  const DevicePlace place = read_place(text);
  DeviceDescription description = DeviceDescription::load(place.name);
  const int usual = description.addresses.front();
  return {std::move(description), place.address.value_or(usual), place.slot.value_or(first_slot)};
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
      if (newest.first_slot() > other.last_slot() || newest.last_slot() < other.first_slot()) {
        continue;
      }
      throw Error(ErrorKind::usage, newest.text(),
                  fmt::format("{} has slot {}, too", other.text(),
                              std::max(newest.first_slot(), other.first_slot())),
                  "give one of them another: NAME@ADDRESS:SLOT");
    }
  }
  return devices;
}

std::string Device::text() const { return fmt::format("{}@0x{:02x}", description_.name, address_); }

std::string Device::fields() const {
  std::string names;
  for (int slot = first_slot_; slot <= last_slot(); ++slot) {
    names += fmt::format("{}I2C{}", names.empty() ? "" : ",", slot);
  }
  return names;
}

DeviceReading Device::reading(const State& state, std::size_t value) const {
  const DeviceValue& each = description_.values[value];
  const I2cReading& read = state.i2c[static_cast<std::size_t>(first_slot_ - 1) + each.poll];
  // Another length is somebody else's reading in that slot.
  const bool whole = read.data.size == description_.polls[each.poll].count;
  return {whole ? each.decode(read.data.bytes, read.data.size) : std::nullopt, read.t_ms,
          read.errors};
}

DeviceReading Device::reading(const State& state, std::string_view value) const {
  const auto found = description_.find(value);
  if (found) return reading(state, *found);
  std::string names;
  for (const DeviceValue& each : description_.values)
    names += (names.empty() ? "" : ", ") + each.name;
  throw Error(ErrorKind::usage, text(), fmt::format("it has no value {}", value),
              "it has " + names);
}

std::vector<DeviceReading> Device::readings(const State& state) const {
  std::vector<DeviceReading> all;
  all.reserve(description_.values.size());
  for (std::size_t i = 0; i < description_.values.size(); ++i) all.push_back(reading(state, i));
  return all;
}

}  // namespace r4
