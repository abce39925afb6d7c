// SPDX-License-Identifier: GPL-3.0-or-later
#include "columns.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <string_view>
#include <utility>

#include "../formats/state_units.hpp"
#include "protocol/messages/state_fields.hpp"
#include "r4link/tables/commands.hpp"

namespace r4::tool::web {
namespace {

std::string_view view(Text text) { return {text.data(), text.size()}; }

struct Channels {
  const char* kind;
  const char* label;
  CommandKind command;
  StateField (*field)(int index);
  std::vector<const char*> parts;
};

StateField at(StateField first, int index) {
  return static_cast<StateField>(static_cast<int>(first) + index);
}

// The first of a kind is one of the paper's ten, the others are further down the table.
StateField split(StateField first, StateField second, int index) {
  return index == 0 ? first : at(second, index - 1);
}

}  // namespace

Columns::Columns(std::vector<Device> devices) : devices_(std::move(devices)) {
  for (int i = 0; i < state_field_count; ++i) {
    const auto field = static_cast<StateField>(i);
    const StateUnits units = units_of(field);
    first_[static_cast<std::size_t>(i)] = names_.size();
    for (std::size_t part = 0; part < units.count; ++part) {
      const std::string_view all = units.values[part];  // "pwm [0-4095]", "[V]"
      const std::size_t bracket = all.find('[');
      std::string name(view(name_of(field)));
      if (bracket != 0 && bracket != std::string_view::npos) {
        name += "." + std::string(all.substr(0, bracket - 1));
      }
      names_.push_back(std::move(name));
      units_.emplace_back(bracket == std::string_view::npos
                              ? std::string_view()
                              : all.substr(bracket + 1, all.size() - bracket - 2));
    }
  }
  first_of_devices_ = names_.size();
  for (const Device& device : devices_) {
    for (const DeviceValue& value : device.description().values) {
      names_.push_back(device.text() + "." + value.name);
      units_.push_back(value.unit);
    }
  }
}

void Columns::fill(const Datagram& state, std::vector<double>& row) const {
  for (const Field& field : state) {
    const StateField known = state_field(field.name());
    if (known == StateField::count) continue;
    std::size_t column = first_[static_cast<std::size_t>(known)];
    const std::size_t parts = units_of(known).count;
    std::string_view rest = view(field.values());
    for (std::size_t part = 0; part < parts; ++part, ++column) {
      const std::size_t comma = std::min(rest.find(','), rest.size());
      std::from_chars(rest.data(), rest.data() + comma, row[column]);
      rest.remove_prefix(std::min(comma + 1, rest.size()));
    }
  }
  State values;
  if (devices_.empty() || !read_state(state, values)) return;
  std::size_t column = first_of_devices_;
  for (const Device& device : devices_) {
    for (std::size_t i = 0; i < device.description().values.size(); ++i, ++column) {
      if (!values.present.has(device.field(i))) continue;
      if (const auto number = device.reading(values, i).number) row[column] = *number;
    }
  }
}

Json channels_json() {
  using F = StateField;
  const std::vector<Channels> kinds{
      {"osmc",
       "OSMC",
       CommandKind::osmc,
       [](int i) { return split(F::osmc1, F::osmc2, i); },
       {".pwm", ".direction"}},
      {"dhb12",
       "DHB12",
       CommandKind::dhb12,
       [](int i) { return split(F::dhb1a, F::dhb1b, i); },
       {".pwm", ".direction"}},
      {"servo",
       "Servo",
       CommandKind::servo,
       [](int i) { return split(F::servo1pos, F::servo2pos, i); },
       {""}},
      {"stepper",
       "Stepper",
       CommandKind::stepper,
       [](int i) { return split(F::step1pos, F::step2pos, i); },
       {""}},
      {"bldc",
       "BLDC",
       CommandKind::bldc,
       [](int i) { return at(F::bldc1, i); },
       {".speed", ".direction", ".brake"}},
      {"relay", "Relay", CommandKind::relay, [](int) { return F::relays; }, {""}}};
  Json all = Json::array();
  for (const Channels& kind : kinds) {
    for (int i = 0; i < row_of(kind.command).channels; ++i) {
      Json fields = Json::array();
      for (const char* part : kind.parts) {
        fields.push_back(std::string(view(name_of(kind.field(i)))) + part);
      }
      all.push_back({{"id", fmt::format("{}{}", kind.kind, i + 1)},
                     {"kind", kind.kind},
                     {"channel", i + 1},
                     {"label", fmt::format("{} {}", kind.label, i + 1)},
                     {"fields", std::move(fields)}});
    }
  }
  return all;
}

}  // namespace r4::tool::web
