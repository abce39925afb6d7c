// SPDX-License-Identifier: GPL-3.0-or-later
#include "conversion.hpp"

#include <utility>

namespace r4::tool {

const char* tell_line(std::string_view line, RecordLine& read, RecordingReader::Handler& handler) {
  read_record_line(line, read);
  switch (read.kind) {
    case LineKind::damaged:
      return read.problem;
    case LineKind::record:
      handler.on_record(read.record);
      return nullptr;
    case LineKind::path:
      handler.on_path(read.path);
      return nullptr;
    case LineKind::header:
      if (read.version != record_version) return "of a later version: read it with a newer r4";
      handler.on_header();
      break;
    case LineKind::device:
      handler.on_device(read.device);
      break;
    case LineKind::comment:
      break;
  }
  handler.on_comment(line);
  return nullptr;
}

void Conversion::on_record(const Record& record) {
  if (!begun_) begin(record.time);
  time_ = record.time;
  ++records_;
  sink_.on_record(without_secrets(record, room_));
}

void Conversion::on_path(const RecordedPath& path) {
  if (!begun_) return wait({true, path, {}});
  sink_.on_path(path, time_);
}

void Conversion::on_comment(std::string_view line) {
  if (!begun_) return wait({false, {}, std::string(line)});
  sink_.on_comment(line, time_);
}

void Conversion::on_damage(const RecordingDamage& damage) {
  ++damage_;
  if (tell_) tell_(damage);
}

void Conversion::finish() {
  if (!begun_) begin(Time{0});
  sink_.finish();
}

void Conversion::wait(Waiting line) {
  waiting_.push_back(std::move(line));
  if (waiting_.size() > most_waiting) begin(Time{0});
}

void Conversion::begin(Time time) {
  begun_ = true;
  time_ = time;
  for (const Waiting& line : waiting_) {
    if (line.is_path) {
      sink_.on_path(line.path, time);
    } else {
      sink_.on_comment(line.comment, time);
    }
  }
  waiting_ = {};
}

}  // namespace r4::tool
