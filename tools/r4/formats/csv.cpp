// SPDX-License-Identifier: GPL-3.0-or-later
#include "csv.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "r4link/tables/state_fields.hpp"

namespace r4::tool {
namespace {

std::string_view view(Text text) { return {text.data(), text.size()}; }

// Appends foreign text as a cell (RFC 4180) in which no spreadsheet finds a formula. An apostrophe
// precedes each character that starts a formula, at the start and after possible separators.
void append_cell(std::string& out, std::string_view others) {
  static constexpr std::string_view formula = "=+-@";
  static constexpr std::string_view separators = " ,;|\"'";
  std::string text;
  bool begins = true;
  for (const char c : printable(others)) {
    if (begins && formula.find(c) != std::string_view::npos) text += '\'';
    begins = separators.find(c) != std::string_view::npos;
    text += c;
  }
  if (text.find_first_of(",\"") == std::string::npos) {
    out += text;
    return;
  }
  out += '"';
  for (const char c : text) {
    if (c == '"') out += '"';
    out += c;
  }
  out += '"';
}

// Most columns for device values: further values get no column. Excel opens 16384 columns.
constexpr std::size_t most_columns = 4096;

}  // namespace

CsvSink::CsvSink(Output& output, std::vector<Device> devices)
    : output_(output), devices_(devices), surveyed_(std::move(devices)) {}

void CsvSink::survey(const RecordedDevice& device) {
  if (const Device* const taken = surveyed_.on_device(device)) add_columns(*taken);
}

void CsvSink::add_columns(const Device& device) {
  const std::string text = device.text();
  for (const DeviceValue& value : device.description().values) {
    const bool known =
        std::any_of(device_columns_.begin(), device_columns_.end(), [&](const DeviceColumn& each) {
          return each.device == text && each.value == value.name && each.unit == value.unit;
        });
    if (known) continue;
    if (device_columns_.size() == most_columns) return;
    device_columns_.push_back({text, value.name, value.unit});
  }
}

void CsvSink::on_device(const RecordedDevice& device) {
  const Device* const taken = devices_.on_device(device);
  if (taken == nullptr || !begun_) return;
  const std::string text = taken->text();
  const bool known = std::any_of(device_columns_.begin(), device_columns_.end(),
                                 [&](const DeviceColumn& each) { return each.device == text; });
  if (!known && late_.empty()) late_ = text;
}

void CsvSink::on_header() {
  devices_.on_header();
  states_.clear();
}

const State* CsvSink::read(const Record& record) {
  const State* const state = states_.take(record);
  return state != nullptr && !state->present.empty() ? state : nullptr;
}

void CsvSink::survey(const Record& record) {
  if (const State* const state = read(record)) columns_.add(state->present);
}

void CsvSink::write_header() {
  begun_ = true;
  if (columns_.empty()) {
    columns_ = FieldSet::all();
    columns_.add(StateField::fault);
  }
  row_ = "time [s],path,board,PNum,T [ms]";
  for (const StateField field : columns_) {
    const FieldKindRow& kind = kind_row_of(field);
    for (int i = 0; i < kind.value_count(); ++i) {
      const auto& [name, unit] = kind.values[i];  // "pwm", "0-4095"
      fmt::format_to(std::back_inserter(row_), ",{}{}{} [{}]", view(name_of(field)),
                     *name == '\0' ? "" : " ", name, unit);
    }
  }
  for (const RecordedDevices::Known& known : devices_.all()) add_columns(known.device);
  for (const DeviceColumn& column : device_columns_) {
    row_ += ',';
    append_cell(row_, fmt::format("{} {}{}", column.device, column.value,
                                  column.unit.empty() ? "" : " [" + column.unit + "]"));
  }
  row_ += '\n';
  output_.write(row_);
}

void CsvSink::on_record(const Record& record) {
  if (!begun_) write_header();
  const State* const state = read(record);
  if (state == nullptr) {
    ++others_;
    return;
  }
  const Datagram& datagram = states_.datagram();
  // The original text of the values: take() has checked their form and number.
  std::array<std::string_view, state_field_count + 1> values;
  for (const Field& field : datagram) {
    values[static_cast<std::size_t>(state_field(field.name()))] = view(field.values());
  }
  row_.clear();
  const auto out = std::back_inserter(row_);
  const auto us = record.time.count();
  fmt::format_to(out, "{}.{:06},{},", us / 1'000'000, us % 1'000'000, record.path);
  append_cell(row_, names_.of(record.path));
  row_ += ',';
  if (datagram.has_pnum()) fmt::format_to(out, "{}", datagram.pnum());
  row_ += ',';
  if (datagram.has_time()) fmt::format_to(out, "{}", datagram.time_ms());
  for (const StateField field : columns_) {
    row_ += ',';
    if (state->present.has(field)) {
      row_ += values[static_cast<std::size_t>(field)];
    } else {
      row_.append(static_cast<std::size_t>(kind_row_of(field).value_count() - 1), ',');
    }
  }
  for (const DeviceColumn& column : device_columns_) {
    row_ += ',';
    append_measured(column, record.path, *state);
  }
  row_ += '\n';
  output_.write(row_);
}

void CsvSink::append_measured(const DeviceColumn& column, std::uint16_t path, const State& state) {
  for (const RecordedDevices::Known& known : devices_.all()) {
    const Device& device = known.device;
    if (!known.is_of(path) || device.text() != column.device) continue;
    const auto value = device.description().find(column.value);
    if (!value || device.description().values[*value].unit != column.unit) continue;
    if (!state.present.has(device.field(*value))) continue;
    if (const auto number = device.reading(state, *value).number) {
      fmt::format_to(std::back_inserter(row_), "{}", *number);
    }
    return;
  }
}

void CsvSink::finish() {
  if (!begun_) write_header();
}

std::string CsvSink::left_out() const {
  std::string text =
      others_ == 0 ? std::string() : fmt::format("{} records that are not states", others_);
  if (!devices_.problems().empty()) text += (text.empty() ? "" : ", ") + devices_.problems();
  if (!late_.empty()) {
    text += fmt::format(
        "{}measurements of {}, which a pipe declares after the first record (convert the file "
        "itself)",
        text.empty() ? "" : ", ", late_);
  }
  return text;
}

}  // namespace r4::tool
