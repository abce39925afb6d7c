// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/devices/device.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "r4link/error.hpp"
#include "r4link/tables/state_fields.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {

namespace {

const I2cReading& read_for(const Device& device, const State& state, std::size_t value) {
  const std::size_t poll = device.description().values[value].poll;
  return state.raw.i2c[static_cast<std::size_t>(device.first_slot() - 1) + poll];
}

// True if the value equals `number`, within the rounding of its scale.
bool is_number(const Device& device, const State& state, std::size_t value, double number) {
  const auto is = device.reading(state, value).number;
  const double step = std::abs(device.description().values[value].scale);
  return is && std::abs(*is - number) <= step / 1e6;
}

}  // namespace

Device::Device(DeviceDescription description, int address, int first_slot)
    : description_(std::move(description)), address_(address), first_slot_(first_slot) {
  const std::vector<int>& possible = description_.addresses;
  if (std::find(possible.begin(), possible.end(), address) == possible.end()) {
    throw Error(
        ErrorKind::usage, text(), "the device cannot have this address",
        fmt::format("use an address of its description: 0x{:02x}", fmt::join(possible, ", 0x")));
  }
  if (first_slot < 1 || first_slot > i2c_slots || last_slot() > i2c_slots) {
    throw Error(ErrorKind::usage, text(),
                fmt::format("the device needs {} slots from slot {} on, and the board has {} slots",
                            description_.polls.size(), first_slot, i2c_slots),
                "choose a lower first slot, or read fewer devices");
  }
}

bool Device::takes_place_of(const Device& other) const {
  return other.address_ == address_ ||
         (other.first_slot_ <= last_slot() && other.last_slot() >= first_slot_);
}

std::string Device::text() const { return fmt::format("{}@0x{:02x}", description_.name, address_); }

std::string Device::place() const { return fmt::format("{}:{}", text(), first_slot_); }

std::string Device::fields() const {
  std::string names;
  for (int slot = first_slot_; slot <= last_slot(); ++slot) {
    const Text name = name_of(state_field(FieldKind::i2c, slot));
    names.append(names.empty() ? "" : ",").append(name.data(), name.size());
  }
  return names;
}

StateField Device::field(std::size_t value) const {
  const int slot = first_slot_ + static_cast<int>(description_.values[value].poll);
  return state_field(FieldKind::i2c, slot);
}

std::optional<bool> Device::is_set_up(const State& state) const {
  std::optional<bool> result;
  for (const DeviceReady& each : description_.ready) {
    if (read_for(*this, state, each.value).data.size == 0) return std::nullopt;
    const bool holds = each.number ? is_number(*this, state, each.value, *each.number)
                                   : reading(state, each.value).number.has_value();
    if (!holds) return false;
    result = true;
  }
  return result;
}

bool Device::counts(const State& state, std::size_t value) const {
  const std::vector<DeviceReady>& ready = description_.ready;
  const bool tells_it = std::any_of(
      ready.begin(), ready.end(), [value](const DeviceReady& each) { return each.value == value; });
  if (!ready.empty() && !tells_it && !is_set_up(state).value_or(false)) return false;
  const auto& only = description_.values[value].only;
  return !only || is_number(*this, state, only->value, only->number);
}

DeviceReading Device::reading(const State& state, std::size_t value) const {
  const DeviceValue& each = description_.values[value];
  const I2cReading& read = read_for(*this, state, value);
  // A reading of another length belongs to another device.
  const bool whole = read.data.size == description_.polls[each.poll].count;
  return {
      whole && counts(state, value) ? each.decode(read.data.bytes, read.data.size) : std::nullopt,
      read.t_ms, read.errors};
}

DeviceReading Device::reading(const State& state, std::string_view value) const {
  const auto found = description_.find(value);
  if (found) return reading(state, *found);
  std::string names;
  for (const DeviceValue& each : description_.values)
    names += (names.empty() ? "" : ", ") + each.name;
  throw Error(ErrorKind::usage, text(), fmt::format("the device has no value {}", value),
              "use one of " + names);
}

std::vector<DeviceReading> Device::readings(const State& state) const {
  std::vector<DeviceReading> all;
  all.reserve(description_.values.size());
  for (std::size_t i = 0; i < description_.values.size(); ++i) all.push_back(reading(state, i));
  return all;
}

}  // namespace r4
