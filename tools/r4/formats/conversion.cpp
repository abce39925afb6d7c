// SPDX-License-Identifier: GPL-3.0-or-later
#include "conversion.hpp"

#include <utility>

namespace r4::tool {

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
