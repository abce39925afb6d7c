// SPDX-License-Identifier: GPL-3.0-or-later
// .log: what `candump -L` prints, a frame a line, as a source and a sink.
//
//     (1436509052.249713) vcan0 244#2A366C2B
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
  CandumpSource(RecordingReader::Handler& handler, std::string name)
      : handler_(handler), records_(handler), name_(std::move(name)) {}
  void feed(std::string_view bytes) override;
  void finish() override;

 private:
  void on_line(std::uint64_t number, std::string_view text);
  void damage(std::uint64_t number, const char* reason);
  [[noreturn]] void fail_as_none() const;

  RecordingReader::Handler& handler_;
  BusRecords records_;
  const std::string name_;
  NumberedLines lines_;
  bool recognised_ = false;
};

class CandumpSink final : public Sink {
 public:
  explicit CandumpSink(Output& output) : output_(output) {}
  void on_comment(std::string_view, Time) override {}
  // Throws Error{data} where the recording has nothing that went over a CAN bus.
  void on_wire(const RecordedWire& wire, Time time) override;
  void on_record(const Record& record) override;
  void finish() override;
  std::string left_out() const override;

 private:
  struct Place {
    std::string interface;
    std::uint8_t node;
    bool fd, packed;
  };
  static std::optional<Place> place_of(const RecordedWire& wire);
  bool write_frames(const Place& place, const Record& record);

  Output& output_;
  std::map<std::uint16_t, Place> wires_;
  std::string elsewhere_;  // the URL of a wire that is no CAN bus
  std::string text_;
  std::uint64_t written_ = 0;
  std::uint64_t others_ = 0;  // events, and datagrams that no transfer holds or of other wires
};

}  // namespace r4::tool
