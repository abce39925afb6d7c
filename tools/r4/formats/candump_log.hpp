// SPDX-License-Identifier: GPL-3.0-or-later
// .log, the output of `candump -L`, one frame a line, as a source and a sink:
//     (1436509052.249713) vcan0 244#2A366C2B
// Times are relative to 1970; with candump -tz to the first frame, whose time the user may give.
// A recording holds datagrams, not frames. The sink creates the frames that boards and hosts would
// send, with flow control, using a CanNode for each end. All frames get the record's time.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "../shell/numbered_lines.hpp"
#include "bus_records.hpp"
#include "conversion.hpp"

namespace r4::tool {

class CandumpSource final : public Source {
 public:
  // `start`: time of the first frame, if times are not relative to 1970.
  CandumpSource(RecordingVisitor& visitor, std::string name,
                std::optional<Time> start = std::nullopt)
      : visitor_(visitor), records_(visitor), name_(std::move(name)), start_(start) {}
  static bool recognises(std::string_view line);
  void feed(std::string_view bytes) override;
  void finish() override;

 private:
  void on_line(std::uint64_t number, std::string_view text);
  std::uint64_t dated(std::uint64_t time_us);
  void damage(std::uint64_t number, const char* reason);
  [[noreturn]] void fail(const char* reason, const char* fix) const;
  [[noreturn]] void fail_as_none() const;

  RecordingVisitor& visitor_;
  BusRecords records_;
  const std::string name_;
  const std::optional<Time> start_;
  NumberedLines lines_;
  bool recognised_ = false;
  bool undated_ = false;
  std::uint64_t frames_ = 0;
  std::uint64_t first_us_ = 0;  // in the log's own time
  std::uint64_t latest_us_ = 0;
};

class CandumpSink final : public Sink {
 public:
  explicit CandumpSink(Output& output) : output_(output) {}
  void on_comment(std::string_view, Time) override {}
  // Throws Error{data} if the recording has no path over a CAN bus.
  void on_path(const RecordedPath& path, Time time) override;
  void on_record(const Record& record) override;
  void finish() override;
  std::string left_out() const override;

 private:
  struct BusAddress {
    std::string interface;
    std::uint8_t node;
    bool fd, packed;
  };
  static std::optional<BusAddress> bus_of(const RecordedPath& path);
  bool write_frames(const BusAddress& bus, const Record& record);

  Output& output_;
  std::map<std::uint16_t, BusAddress> paths_;
  std::string elsewhere_;  // URL of a path that is not a CAN bus
  std::string text_;
  std::uint64_t written_ = 0;
  std::uint64_t others_ = 0;  // events, and datagrams that cannot be written
};

}  // namespace r4::tool
