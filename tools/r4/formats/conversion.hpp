// SPDX-License-Identifier: GPL-3.0-or-later
// What every format of recordings is to `r4 convert`: a source that tells what is in a file, or a sink that makes a
// file of it, in constant memory however long the recording is.
//
//     file --> Source --(RecordingVisitor)--> Conversion --> Sink --> Output
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "r4link/recordings/record_line.hpp"
#include "r4link/recordings/recording_visitor.hpp"

namespace r4::tool {

// Tells a RecordingVisitor what is in a file. What cannot be read is told as damage, with the line 0 where
// the format has none, and the rest is read.
class Source {
 public:
  virtual ~Source() = default;
  // Takes the next bytes. Throws Error{data} for a file of another kind.
  virtual void feed(std::string_view bytes) = 0;
  // The file has ended. Throws Error{data} if it was of another kind.
  virtual void finish() = 0;
};

// Where a sink writes to.
class Output {
 public:
  // Throws Error.
  virtual void write(std::string_view bytes) = 0;

 protected:
  ~Output() = default;
};

// Makes a file of what it is told. Each throws Error when the file cannot be written, or cannot hold that.
class Sink {
 public:
  virtual ~Sink() = default;
  // Does it want to be told of all paths and records by survey() first? Where a file can be read once only, it is not.
  virtual bool wants_survey() const { return false; }
  virtual void survey(const RecordedPath& path) { static_cast<void>(path); }
  virtual void survey(const RecordedDevice& device) { static_cast<void>(device); }
  virtual void survey(const Record& record) { static_cast<void>(record); }
  // A line that begins with #; such lines have no time of their own, so it is that of the record before, and of the
  // first one for those at the beginning.
  virtual void on_comment(std::string_view line, Time time) = 0;
  virtual void on_path(const RecordedPath& path, Time time) = 0;
  // Comes before its line does by on_comment(); that of a header, too.
  virtual void on_device(const RecordedDevice& device) { static_cast<void>(device); }
  virtual void on_header() {}
  virtual void on_record(const Record& record) = 0;
  // All was told.
  virtual void finish() = 0;
  // What of it the file does not hold, for people: "12 that are no state"; empty: it holds everything.
  virtual std::string left_out() const { return {}; }
};

// A first look at a recording for a sink.
class Survey final : public RecordingVisitor {
 public:
  explicit Survey(Sink& sink) : sink_(sink) {}
  void on_record(const Record& record) override { sink_.survey(record); }
  void on_path(const RecordedPath& path) override { sink_.survey(path); }
  void on_device(const RecordedDevice& device) override { sink_.survey(device); }
  void on_damage(const RecordingDamage&) override {}

 private:
  Sink& sink_;
};

// From a source to a sink.
class Conversion final : public RecordingVisitor {
 public:
  using TellDamage = std::function<void(const RecordingDamage&)>;

  Conversion(Sink& sink, TellDamage tell) : sink_(sink), tell_(std::move(tell)) {}

  // Whatever the source is, no secret gets into another file.
  void on_record(const Record& record) override;
  void on_path(const RecordedPath& path) override;
  void on_comment(std::string_view line) override;
  void on_header() override { sink_.on_header(); }
  void on_device(const RecordedDevice& device) override { sink_.on_device(device); }
  void on_damage(const RecordingDamage& damage) override;
  // The source has ended.
  void finish();

  std::uint64_t records() const { return records_; }
  std::uint64_t damage() const { return damage_; }

 private:
  // So many lines wait for the first record's time; a file that has more is none that r4 wrote.
  static constexpr std::size_t most_waiting = 1000;
  struct Waiting {
    bool is_path;
    RecordedPath path;
    std::string comment;
  };
  void wait(Waiting line);
  void begin(Time time);

  Sink& sink_;
  const TellDamage tell_;
  std::vector<Waiting> waiting_;  // until begun_
  RecordRoom room_;
  bool begun_ = false;
  Time time_{0};  // of the newest record
  std::uint64_t records_ = 0;
  std::uint64_t damage_ = 0;
};

}  // namespace r4::tool
