// SPDX-License-Identifier: GPL-3.0-or-later
#include "columns.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <utility>

#include "r4link/tables/state_fields.hpp"
#include "r4link/vocabulary.hpp"

namespace r4::tool::web {
namespace {

std::string_view view(Text text) { return {text.data(), text.size()}; }

// The column of a value: "AIN24", "OSMC1.pwm".
std::string column_of(const StateFieldRow& field, const FieldValue& value) {
  std::string name(view(field.name));
  if (*value.name != '\0') name.append(".").append(value.name);
  return name;
}

}  // namespace

Columns::Columns(std::vector<Device> devices) : devices_(std::move(devices)) {
  for (const StateFieldRow& row : state_fields) {
    first_[static_cast<std::size_t>(row.field)] = names_.size();
    const FieldKindRow& kind = row_of(row.kind);
    for (int i = 0; i < kind.value_count(); ++i) {
      names_.push_back(column_of(row, kind.values[i]));
      units_.emplace_back(kind.values[i].unit);
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
  State values;
  if (!read_state(state, values)) return;
  for (const StateField field : values.present) {
    const StateNumbers numbers = numbers_of(values, field);
    std::copy_n(numbers.values, numbers.count, &row[first_[static_cast<std::size_t>(field)]]);
  }
  std::size_t column = first_of_devices_;
  for (const Device& device : devices_) {
    for (std::size_t i = 0; i < device.description().values.size(); ++i, ++column) {
      if (!values.present.has(device.field(i))) continue;
      if (const auto number = device.reading(values, i).number) row[column] = *number;
    }
  }
}

Json channels_json() {
  Json all = Json::array();
  const auto add = [&all](const char* kind, const char* label, int channel,
                          const StateFieldRow& row) {
    Json fields = Json::array();
    for (int i = 0; i < row_of(row.kind).value_count(); ++i) {
      fields.push_back(column_of(row, row_of(row.kind).values[i]));
    }
    all.push_back({{"id", fmt::format("{}{}", kind, channel)},
                   {"kind", kind},
                   {"channel", channel},
                   {"label", fmt::format("{} {}", label, channel)},
                   {"fields", std::move(fields)}});
  };
  constexpr std::pair<FieldKind, const char*> kinds[] = {{FieldKind::osmc, "OSMC"},
                                                         {FieldKind::dhb12, "DHB12"},
                                                         {FieldKind::servo, "Servo"},
                                                         {FieldKind::stepper, "Stepper"},
                                                         {FieldKind::bldc, "BLDC"}};
  for (const auto& [kind, label] : kinds) {
    for (const StateFieldRow& row : state_fields) {
      if (row.kind == kind) add(row_of(kind).name, label, row.channel, row);
    }
  }
  for (int i = 1; i <= relay_channels; ++i) add("relay", "Relay", i, row_of(StateField::relays));
  return all;
}

}  // namespace r4::tool::web
