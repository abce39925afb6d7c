// SPDX-License-Identifier: GPL-3.0-or-later
// .log: what `candump -L` prints, a frame a line, as a source and a sink.
//
//     (1436509052.249713) vcan0 244#2A366C2B
//
// Times count from 1970. Those of candump -tz count from the first frame, which the user may date.
//
// A recording has datagrams, not frames. The sink makes the frames of them that boards and hosts send, flow control
// included, all at the record's time: by the CanNode of both ends.
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
  // `start`: when the first frame was, where times do not count from 1970.
  CandumpSource(RecordingVisitor& visitor, std::string name,
                std::optional<Time> start = std::nullopt)
      : visitor_(visitor), records_(visitor), name_(std::move(name)), start_(start) {}
  // True if a log of frames may have that line.
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
  bool undated_ = false;  // a frame without a time was told
  std::uint64_t frames_ = 0;
  std::uint64_t first_us_ = 0;  // as the log counts
  std::uint64_t latest_us_ = 0;
};

class CandumpSink final : public Sink {
 public:
  explicit CandumpSink(Output& output) : output_(output) {}
  void on_comment(std::string_view, Time) override {}
  // Throws Error{data} where the recording has nothing that went over a CAN bus.
  void on_path(const RecordedPath& path, Time time) override;
  void on_record(const Record& record) override;
  void finish() override;
  std::string left_out() const override;

 private:
  struct Place {
    std::string interface;
    std::uint8_t node;
    bool fd, packed;
  };
  static std::optional<Place> place_of(const RecordedPath& path);
  bool write_frames(const Place& place, const Record& record);

  Output& output_;
  std::map<std::uint16_t, Place> paths_;
  std::string elsewhere_;  // the URL of a path that is no CAN bus
  std::string text_;
  std::uint64_t written_ = 0;
  std::uint64_t others_ = 0;  // events, and datagrams that no transfer holds or of other paths
};

}  // namespace r4::tool
