// SPDX-License-Identifier: GPL-3.0-or-later
// The datagrams of one board in a recording, and the events of its transport, in order.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "../recording/recording_file.hpp"
#include "r4link/recordings/recording_reader.hpp"

namespace r4 {

struct ReplayStart {
  Time time{0};  // after the first record; if `absolute`, by the recording's clock
  bool absolute = false;

  // Seconds "12.5", or UTC "2026-11-23T21:20:00". Throws Error{usage} about `thing`.
  static ReplayStart of(const std::string& thing, const std::string& text);
};

class ReplayRecords final : private RecordingVisitor {
 public:
  struct Item {
    Time time;  // as recorded
    RecordKind kind = RecordKind::event;
    // A datagram, or an event: "up …", "down …", "warning …" (also for a damaged file).
    std::string bytes;
  };

  // Reads up to the first record of `path` at or after `start`. Accepts only regular files, because
  // reading must not wait. Throws Error about `thing`.
  ReplayRecords(const std::string& thing, const std::string& file, std::uint16_t path,
                const ReplayStart& start);

  // The next item, which take() removes; null if no item was read yet.
  const Item* next() const { return waiting_.empty() ? nullptr : &waiting_.front(); }
  Item take();
  // Reads at most 16 KiB more. False if the file has ended and no item waits. Throws Error.
  bool read_on();

 private:
  void on_record(const Record& record) override;
  void on_path(const RecordedPath&) override {}
  void on_damage(const RecordingDamage& damage) override;

  const std::uint16_t path_;
  ReplayStart start_;  // absolute after the first record
  RecordingInput input_;
  RecordingReader reader_;
  bool ended_ = false;
  std::optional<Time> passed_over_;  // of the latest skipped record of `path`
  std::optional<Time> latest_;       // of the latest item
  std::deque<Item> waiting_;
};

}  // namespace r4
