// SPDX-License-Identifier: GPL-3.0-or-later
// What is behind a Recording: boards put records in, from any thread and without waiting; a thread of its own writes
// them.
//
//     record() -- 4 MiB at most --> the writer's thread --> RecordingWriter --> the disk
//
// The two meet for as long as it takes to copy a datagram. Times are those of the steady clock, from the wall clock
// at the beginning: whoever sets the wall clock moves no record, and is told of in the recording.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "r4link/error.hpp"
#include "record.hpp"
#include "recording_writer.hpp"

namespace r4 {

// It has more than 15 members: they are grouped by the thread that may touch them.
class Recorder {
 public:
  // Opens the file. Throws Error.
  Recorder(const std::string& path, const RecordingOptions& options);
  ~Recorder();
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  // The number of a new path.
  std::uint16_t add_path(std::string url);
  // What the board there calls itself.
  void name_path(std::uint16_t path, std::string name);
  // What the bytes of one of its devices mean.
  void add_device(RecordedDevice device);
  // Copies it. Allocates nothing; beyond max_record_bytes it is cut. `at`: when it was, by the steady clock; records
  // are written in the order of their times if none is told of more than `settled` later.
  void record(std::uint16_t path, RecordKind kind, std::string_view bytes, Time at);
  void record(std::uint16_t path, RecordKind kind, std::string_view bytes) {
    record(path, kind, bytes, steady_now());
  }

  // Writes what waits and ends the file.
  void close();

  // It records nothing any more. No lock: for every datagram.
  bool ended() const { return ended_.load(std::memory_order_acquire); }
  std::optional<Problem> problem() const;
  // What has happened to it: it was begun anew, or has ended by itself. `known`: how much of that is known already.
  std::optional<Problem> news(unsigned& known) const;
  unsigned news_count() const { return news_count_.load(std::memory_order_acquire); }
  std::uint64_t records() const;
  std::uint64_t dropped() const;

  static constexpr std::size_t capacity = 4 << 20;
  static constexpr std::chrono::milliseconds settled{50};

 private:
  // Before each record's bytes in the buffer.
  struct Head {
    Time time;
    std::uint32_t size;
    std::uint16_t path;
    RecordKind kind;
  };
  struct Place {
    Head head;
    const char* at;
  };

  static Time wall_clock();
  static Time steady_now();
  Time recorded(Time steady) const { return began_ + (steady - began_steady_); }
  Time now() const { return recorded(steady_now()); }
  void run();
  void write();
  void put_in_order(const std::vector<char>& records);
  void write_event(const std::string& text);
  void tell_of_the_clock();
  void tell_of_what_was_dropped();
  void tell_of_the_file();
  void tell_of_trouble(const Problem& trouble, bool is_problem);

  // Of the writer's thread.
  RecordingWriter writer_;
  std::vector<char> batch_;
  std::vector<char> unsettled_;  // records that came so late that earlier ones may follow
  std::vector<Place> order_;
  Time written_until_{0};
  Time clock_told_{0};  // by how much the wall clock was set, as the recording has it
  std::uint64_t dropped_told_ = 0;
  const Time began_;  // by the wall clock
  const Time began_steady_ = steady_now();

  std::atomic<bool> ended_{false};
  std::atomic<unsigned> news_count_{0};
  mutable std::mutex mutex_;  // of what follows
  std::condition_variable wanted_;
  std::vector<char> waiting_;
  std::vector<RecordedPath> paths_;
  std::vector<std::uint16_t> undeclared_;
  std::vector<RecordedDevice> undeclared_devices_;
  std::uint64_t records_ = 0;
  std::uint64_t dropped_ = 0;
  bool closing_ = false;
  std::optional<Problem> problem_;
  std::optional<Problem> news_;  // the newest

  std::mutex joining_;
  std::thread thread_;
};

}  // namespace r4
