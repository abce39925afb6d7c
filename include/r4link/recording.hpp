// SPDX-License-Identifier: GPL-3.0-or-later
// r4::Recording: a file with every datagram of one or several boards (docs/how-to/recordings.md).
//     r4::Board board("udp://192.168.0.125");
//     board.record("drive.r4log");
//
//     r4::Recording recording("drive.r4log.zst");   // of two boards
//     left.record(recording);
//     right.record(recording);
//
// A recording holds datagrams in both directions, also damaged datagrams, with the host's time, and
// events of transports and links. A thread writes to the disk four times a second: a crash costs at
// most the last second. The link never waits for the disk: 4 MiB are buffered, and lost records are
// counted. If the disk is full, the recording ends, on_event() reports that (kind open), and the
// link continues. If another program moves, removes or truncates the file, the recording continues
// in a new file of that name, and on_event() reports that.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "config.hpp"
#include "error.hpp"
#include "recordings/recorded_states.hpp"
#include "recordings/recording_visitor.hpp"

namespace r4 {

class Recorder;

struct RecordingOptions {
  // Starts a new file after this size or time, whichever is reached first; 0: no limit. With any
  // limit, drive.r4log becomes drive-00001.r4log, drive-00002.r4log …, each complete in itself.
  std::uint64_t rotate_bytes = 0;
  std::chrono::seconds rotate_after{0};
  // Total bytes to keep: the oldest of the numbered files are removed, also files of earlier runs.
  // At least 1 MiB and four times rotate_bytes; 0: all files are kept.
  std::uint64_t keep_bytes = 0;
};

// Reads a recording, compressed or not, in constant memory; blocks until its end. "-" is the
// standard input. Throws Error: open, permission, data. Example: docs/how-to/recordings.md.
R4LINK_API void read_recording(const std::string& path, RecordingVisitor& visitor);

class R4LINK_API Recording {
 public:
  // Opens the file, compressed if its name ends in .zst; an existing recording is continued. Throws
  // Error: open, permission, data for a file with other content, usage for wrong options.
  explicit Recording(const std::string& path, RecordingOptions options = {});
  ~Recording();
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;

  // Writes the buffer and waits for the disk. Later datagrams are ignored. Any thread; idempotent.
  void close();

  // Why the recording ended early; empty: no problem. Kind `data`: the recording continues, but the
  // file was removed or truncated, and its content is lost.
  std::optional<Problem> problem() const;
  // Datagrams and events so far: in the recording, and lost because the disk was too slow.
  std::uint64_t records() const;
  std::uint64_t dropped() const;

 private:
  friend class AsyncBoard;
  std::shared_ptr<Recorder> recorder_;
};

}  // namespace r4
