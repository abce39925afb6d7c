// SPDX-License-Identifier: GPL-3.0-or-later
#include "columns.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <string_view>
#include <utility>

#include "r4link/commands/command_text.hpp"
#include "r4link/tables/state_fields.hpp"
#include "r4link/vocabulary.hpp"

namespace r4::tool::web {
namespace {

std::string_view view(Text text) { return {text.data(), text.size()}; }

std::string column_of(const StateFieldRow& field, const FieldValue& value) {
  std::string name(view(field.name));
  if (*value.name != '\0') name.append(".").append(value.name);
  return name;
}

// Adds an output's command with placeholders, "O:{value},{direction},1", and ranges.
void add_command(Json& output, const CommandRow& row, int channel) {
  std::string command = fmt::format("{}:{}", row.letter, view(row.word));
  for (const CommandValue each : row) {
    const ValueRow& value = row_of(each);
    if (command.back() != ':') command += ',';
    switch (value.role) {
      case ValueRole::channel:
        command += std::to_string(channel);
        break;
      case ValueRole::direction:
        command += "{direction}";
        break;
      case ValueRole::on:
        command += "{brake}";
        break;
      case ValueRole::on_off:
        command += "{switch}";
        break;
      case ValueRole::speed:
        command += "{speed}";
        output["speed"] = {{"min", value.min}, {"max", value.max}, {"value", value.missing}};
        break;
      default:
        command += "{value}";
        output["min"] = value.min;
        output["max"] = value.max;
    }
  }
  output["command"] = command;
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
  for (const CommandRow& row : command_rows) {
    const FieldKind shown = shown_by(row.kind);
    if (shown == FieldKind::count) continue;
    const FieldKindRow& kind = row_of(shown);
    std::string title(name_of(row.kind));
    std::string id = title;
    std::transform(id.begin(), id.end(), id.begin(), [](char c) { return std::tolower(c); });
    title[0] = static_cast<char>(std::toupper(title[0]));
    for (int channel = 1; channel <= row.channels; ++channel) {
      const bool relay = row.kind == CommandKind::relay;
      const StateFieldRow& field = row_of(state_field(shown, relay ? 1 : channel));
      Json fields = Json::array();
      for (int i = 0; i < kind.value_count(); ++i) {
        fields.push_back(column_of(field, kind.values[i]));
      }
      Json object{
          {"id", fmt::format("{}{}", id, channel)},
          {"kind", id},
          {"channel", channel},
          {"title", title},
          {"label", fmt::format("{} {}", title, channel)},
          {"name", *kind.values[0].name != '\0' ? kind.values[0].name : kind.values[0].unit},
          {"fields", std::move(fields)}};
      add_command(object, row, channel);
      all.push_back(std::move(object));
    }
  }
  return all;
}

}  // namespace r4::tool::web
