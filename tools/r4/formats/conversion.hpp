// SPDX-License-Identifier: GPL-3.0-or-later
// `r4 convert`, in constant memory: a source reads a file of any format, a sink writes one.
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

// Reports unreadable parts as damage (line 0 if the format has no lines), and continues.
class Source {
 public:
  virtual ~Source() = default;
  // Takes the next bytes. Throws Error{data} if the file has another format.
  virtual void feed(std::string_view bytes) = 0;
  // Call at the end of the file. Throws Error{data} if the file had another format.
  virtual void finish() = 0;
};

class Output {
 public:
  virtual void write(std::string_view bytes) = 0;

 protected:
  ~Output() = default;
};

// Writes a file. Each function throws Error if the file cannot be written or cannot hold the data.
class Sink {
 public:
  virtual ~Sink() = default;
  // True if survey() should get the whole recording first, for which the input is read twice.
  virtual bool wants_survey() const { return false; }
  virtual void survey(const RecordedPath& path) { static_cast<void>(path); }
  virtual void survey(const RecordedDevice& device) { static_cast<void>(device); }
  virtual void survey(const Record& record) { static_cast<void>(record); }
  // A line that begins with #. `time`: of the previous record, else of the first record.
  virtual void on_comment(std::string_view line, Time time) = 0;
  virtual void on_path(const RecordedPath& path, Time time) = 0;
  // Like on_header(), called before on_comment() for the same line.
  virtual void on_device(const RecordedDevice& device) { static_cast<void>(device); }
  virtual void on_header() {}
  virtual void on_record(const Record& record) = 0;
  virtual void finish() = 0;
  // The missing part, for people: "12 that are not states"; empty: nothing is missing.
  virtual std::string left_out() const { return {}; }
};

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

class Conversion final : public RecordingVisitor {
 public:
  using TellDamage = std::function<void(const RecordingDamage&)>;

  Conversion(Sink& sink, TellDamage tell) : sink_(sink), tell_(std::move(tell)) {}

  // Removes secrets, whatever the source.
  void on_record(const Record& record) override;
  void on_path(const RecordedPath& path) override;
  void on_comment(std::string_view line) override;
  void on_header() override { sink_.on_header(); }
  void on_device(const RecordedDevice& device) override { sink_.on_device(device); }
  void on_damage(const RecordingDamage& damage) override;
  void finish();

  std::uint64_t records() const { return records_; }
  std::uint64_t damage() const { return damage_; }

 private:
  // Lines that may wait for the first record's time. Files from r4 have fewer such lines.
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
  std::vector<Waiting> waiting_;
  RecordRoom room_;
  bool begun_ = false;
  Time time_{0};
  std::uint64_t records_ = 0;
  std::uint64_t damage_ = 0;
};

}  // namespace r4::tool
