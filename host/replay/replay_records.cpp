// SPDX-License-Identifier: GPL-3.0-or-later
#include "replay_records.hpp"

#include <filesystem>
#include <system_error>
#include <utility>

namespace r4 {
namespace {

const std::string& readable(const std::string& thing, const std::string& path) {
  std::error_code error;
  const std::filesystem::file_status file = std::filesystem::status(path, error);
  if (std::filesystem::is_regular_file(file)) return path;
  const bool directory = std::filesystem::is_directory(file);
  throw Error(ErrorKind::open, thing,
              error       ? error.message()
              : directory ? "is a directory"
                          : "is no regular file",
              "name a file that r4 record has written");
}

bool is_of_the_transport(std::string_view event) {
  return event.starts_with("up ") || event.starts_with("down ") || event.starts_with("warning ");
}

}  // namespace

ReplayRecords::ReplayRecords(const std::string& thing, const std::string& path, std::uint16_t wire,
                             Time from)
    : wire_(wire), from_(from), input_(readable(thing, path)), reader_(*this, path) {
  while (waiting_.empty() && read_on()) {
  }
  if (!waiting_.empty()) return;
  throw Error(ErrorKind::data, thing, "nothing of that wire is there",
              "r4 info " + path + " lists the wires; begin earlier in it");
}

ReplayRecords::Item ReplayRecords::take() {
  Item item = std::move(waiting_.front());
  waiting_.pop_front();
  return item;
}

bool ReplayRecords::read_on() {
  if (ended_) return false;
  const std::string_view piece = input_.read();
  ended_ = piece.empty();
  ended_ ? reader_.finish() : reader_.feed(piece);
  return !ended_ || !waiting_.empty();
}

void ReplayRecords::on_record(const Record& record) {
  if (!beginning_) beginning_ = record.time;
  if (record.wire != wire_ || record.kind == RecordKind::to_board) return;
  if (record.time - *beginning_ < from_) return;
  if (record.kind == RecordKind::event && !is_of_the_transport(record.bytes)) return;
  latest_ = record.time;
  waiting_.push_back({record.time, record.kind, std::string(record.bytes)});
}

void ReplayRecords::on_damage(const RecordingDamage& damage) {
  if (!latest_) return;
  waiting_.push_back(
      {*latest_, RecordKind::event,
       "warning line " + std::to_string(damage.line) + ": " + std::string(damage.reason)});
}

}  // namespace r4
