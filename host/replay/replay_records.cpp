// SPDX-License-Identifier: GPL-3.0-or-later
#include "replay_records.hpp"

#include <filesystem>
#include <system_error>
#include <utility>

#include "../../protocol/datagram/numbers.hpp"
#include "r4link/recordings/record_line.hpp"

namespace r4 {
namespace {

const std::string& readable(const std::string& thing, const std::string& file) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(file, error);
  if (std::filesystem::is_regular_file(status)) return file;
  const bool directory = std::filesystem::is_directory(status);
  throw Error(ErrorKind::open, thing,
              error       ? error.message()
              : directory ? "is a directory"
                          : "is not a regular file",
              "give a file that r4 record has written");
}

bool is_of_the_transport(std::string_view event) {
  return event.starts_with("up ") || event.starts_with("down ") || event.starts_with("warning ");
}

}  // namespace

ReplayStart ReplayStart::of(const std::string& thing, const std::string& text) {
  if (const std::optional<Time> time = read_record_time(text)) return {*time, true};
  std::int32_t hundredths = 0;
  if (parse_hundredths(Text(text), hundredths) && hundredths >= 0) {
    return {Time{std::int64_t{hundredths} * 10'000}, false};
  }
  throw Error(ErrorKind::usage, thing, text + " is neither seconds nor a time",
              "write seconds such as 12.5, or a time in UTC such as 2026-11-23T21:20:00");
}

ReplayRecords::ReplayRecords(const std::string& thing, const std::string& file, std::uint16_t path,
                             const ReplayStart& start)
    : path_(path), start_(start), input_(readable(thing, file)), reader_(*this, file) {
  while (waiting_.empty() && read_on()) {
  }
  if (!waiting_.empty()) return;
  if (passed_over_) {
    throw Error(ErrorKind::data, thing,
                "the last record of that path is of " + record_time_text(*passed_over_) +
                    ", before the requested start",
                "choose an earlier start; r4 info " + file + " shows the times of the recording");
  }
  throw Error(ErrorKind::data, thing, "that path has no records",
              "choose another path; r4 info " + file + " lists the paths");
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
  if (!std::exchange(start_.absolute, true)) start_.time += record.time;
  if (record.path != path_ || record.kind == RecordKind::to_board) return;
  if (record.kind == RecordKind::event && !is_of_the_transport(record.bytes)) return;
  if (record.time < start_.time) {
    passed_over_ = record.time;
    return;
  }
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
