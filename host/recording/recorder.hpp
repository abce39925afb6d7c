// SPDX-License-Identifier: GPL-3.0-or-later
// Implements Recording. Boards add records from any thread without waiting for the disk.
//     record() -- at most 4 MiB --> the writer's thread --> RecordingWriter --> the disk
//
// The threads share a lock while a datagram is copied. A record's time is the wall clock at the
// start plus the steady clock's time since then. If the wall clock is set, an event reports it.
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
#include "r4link/recordings/record.hpp"
#include "recording_writer.hpp"

namespace r4 {

// More than 15 members, grouped by the thread that may touch them.
class Recorder {
 public:
  // Opens the file. Throws Error.
  Recorder(const std::string& path, const RecordingOptions& options);
  ~Recorder();
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  std::uint16_t add_path(std::string url);
  // `name`: of the path's board.
  void name_path(std::uint16_t path, std::string name);
  void add_device(RecordedDevice device);
  // Copies `bytes`, at most max_record_bytes, without allocating. `at`: by the steady clock.
  // If each record arrives at most `settled` after its time, records are written in order of time.
  void record(std::uint16_t path, RecordKind kind, std::string_view bytes, Time at);
  void record(std::uint16_t path, RecordKind kind, std::string_view bytes) {
    record(path, kind, bytes, steady_now());
  }

  // Writes all waiting records and ends the file.
  void close();

  // True if the recording has ended. Takes no lock, because it is called for every datagram.
  bool ended() const { return ended_.load(std::memory_order_acquire); }
  std::optional<Problem> problem() const;
  // Why the file was restarted or the recording ended. Updates `known`, the caller's news count.
  std::optional<Problem> news(unsigned& known) const;
  unsigned news_count() const { return news_count_.load(std::memory_order_acquire); }
  std::uint64_t records() const { return records_; }
  std::uint64_t dropped() const { return dropped_; }

  static constexpr std::size_t capacity = 4 << 20;
  static constexpr std::chrono::milliseconds settled{50};

 private:
  // Precedes each record's bytes in the buffer.
  struct Head {
    Time time;
    std::uint32_t size;
    std::uint16_t path;
    RecordKind kind;
  };
  struct RecordAt {
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
  void record_set_clock();
  void record_dropped();
  void record_new_file();
  void report(const Problem& trouble, bool is_problem);

  // Used by the writer's thread.
  RecordingWriter writer_;
  std::vector<char> batch_;
  std::vector<char> unsettled_;  // so new that earlier records may follow
  std::vector<RecordAt> order_;
  Time written_until_{0};
  Time recorded_clock_{0};  // recorded change of the wall clock
  std::uint64_t recorded_dropped_ = 0;
  const Time began_;  // by the wall clock
  const Time began_steady_ = steady_now();

  std::atomic<bool> ended_{false};
  std::atomic<unsigned> news_count_{0};
  std::atomic<std::uint64_t> records_{0}, dropped_{0};
  mutable std::mutex mutex_;  // for the members down to joining_
  std::condition_variable wanted_;
  std::vector<char> waiting_;
  std::vector<RecordedPath> paths_;
  std::vector<RecordedPath> undeclared_;
  std::vector<RecordedDevice> undeclared_devices_;
  bool closing_ = false;
  std::optional<Problem> problem_;
  std::optional<Problem> news_;

  std::mutex joining_;
  std::thread thread_;
};

}  // namespace r4
