// SPDX-License-Identifier: GPL-3.0-or-later
#include "csv.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "protocol/messages/message.hpp"
#include "protocol/messages/state_fields.hpp"

namespace r4::tool {
namespace {

std::string_view view(Text text) { return {text.data(), text.size()}; }

// The headers of a field's values, without its name: "" is the only one there is.
struct Values {
  std::array<std::string_view, 3> units;
  std::size_t count;
};

constexpr Values one(std::string_view unit) { return {{unit, {}, {}}, 1}; }

Values values_of(StateField field) {
  using F = StateField;
  const auto within = [field](F first, F last) { return field >= first && field <= last; };
  if (field == F::dmhsta) return one("[0/1]");
  if (within(F::ain24, F::ainsteer) || field == F::ain6) return one("[V]");
  if (within(F::dhb1a, F::osmc1) || within(F::dhb1b, F::osmc4)) {
    return {{"pwm [0-4095]", "direction [0/1]", {}}, 2};
  }
  if (field == F::step1pos || within(F::step2pos, F::step4pos)) return one("[steps]");
  if (field == F::servo1pos || within(F::servo2pos, F::servo16pos)) return one("[us]");
  if (within(F::enc1, F::enc4) || within(F::enc1idx, F::enc4idx)) return one("[counts]");
  if (within(F::us1, F::us4)) return one("[cm]");
  if (within(F::bldc1, F::bldc4)) {
    return {{"speed [0-4095]", "direction [0/1]", "brake [0/1]"}, 3};
  }
  if (field == F::relays) return one("[bits]");
  if (field == F::safe) return one("[reason]");
  if (field == F::cmd) return one("[PNum]");
  if (within(F::rxok, F::rxdup)) return one("[datagrams]");
  if (field == F::rxref) return one("[commands]");
  if (field == F::late) return one("[periods]");
  if (within(F::enc1hz, F::enc4hz)) return one("[counts/s]");
  return {{"chip [address]", "trouble [bits]", {}}, 2};  // FAULT
}

void append_quoted(std::string& out, std::string_view text) {
  if (text.find_first_of(",\"\r\n") == std::string_view::npos) {
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

}  // namespace

bool CsvSink::read(const Record& record) {
  return record.kind == RecordKind::from_board && read_datagram(Text(record.bytes), datagram_) &&
         kind_of(datagram_) == MessageKind::state && read_state(datagram_, state_) &&
         !state_.present.empty();
}

void CsvSink::survey(const Record& record) {
  if (read(record)) columns_.add(state_.present);
}

void CsvSink::write_header() {
  begun_ = true;
  if (columns_.empty()) {
    columns_ = FieldSet::all();
    columns_.add(StateField::fault);
  }
  row_ = "time [s],wire,board,PNum,T [ms]";
  for (const StateField field : columns_) {
    const Values values = values_of(field);
    for (std::size_t i = 0; i < values.count; ++i) {
      fmt::format_to(std::back_inserter(row_), ",{} {}", view(name_of(field)), values.units[i]);
    }
  }
  row_ += '\n';
  output_.write(row_);
}

void CsvSink::on_record(const Record& record) {
  if (!begun_) write_header();
  if (!read(record)) {
    ++others_;
    return;
  }
  // A field's values as they came: read_state() has found that they are numbers, and how many.
  std::array<std::string_view, state_field_count + 1> values;
  for (const Field& field : datagram_) {
    values[static_cast<std::size_t>(state_field(field.name()))] = view(field.values());
  }
  row_.clear();
  const auto out = std::back_inserter(row_);
  const auto us = record.time.count();
  fmt::format_to(out, "{}.{:06},{},", us / 1'000'000, us % 1'000'000, record.wire);
  append_quoted(row_, names_.of(record.wire));
  row_ += ',';
  if (datagram_.has_pnum()) fmt::format_to(out, "{}", datagram_.pnum());
  row_ += ',';
  if (datagram_.has_time()) fmt::format_to(out, "{}", datagram_.time_ms());
  for (const StateField field : columns_) {
    row_ += ',';
    if (state_.present.has(field)) {
      row_ += values[static_cast<std::size_t>(field)];
    } else {
      row_.append(values_of(field).count - 1, ',');
    }
  }
  row_ += '\n';
  output_.write(row_);
}

void CsvSink::finish() {
  if (!begun_) write_header();
}

std::string CsvSink::left_out() const {
  return others_ == 0 ? std::string() : fmt::format("{} that are no state", others_);
}

}  // namespace r4::tool
