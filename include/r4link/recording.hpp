// SPDX-License-Identifier: GPL-3.0-or-later
// r4::Recording: every datagram of one or several boards, in a file (docs/recordings.md).
//
//     r4::Board board("udp://192.168.0.125");
//     board.record("drive.r4log");
//
//     r4::Recording recording("drive.r4log.zst");   // of two boards
//     left.record(recording);
//     right.record(recording);
//
// What is recorded: datagrams in both directions, damaged ones too, with the host's time; that the transport went
// or came, how the link is, what was lost. A thread writes it, four times a second and to the disk, so that a
// crash costs at most the last second. The link waits for no disk: 4 MiB wait for a slow one, and of what is
// beyond that the recording tells how much it is. When the disk is full the recording ends, on_event() of the board
// reports it (kind open), and the link goes on. If another program moves, removes or truncates the file, it is begun anew
// under its name, and on_event() reports that.
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
  // A new file after so many bytes, or so much time, whichever is first; 0: no limit. With any of these limits the
  // files are drive-00001.r4log, drive-00002.r4log … for the name drive.r4log, each whole in itself.
  std::uint64_t rotate_bytes = 0;
  std::chrono::seconds rotate_after{0};
  // So many bytes are kept: the oldest of these files are removed, also those of an earlier run by that name. At
  // least 1 MiB, and four times rotate_bytes; 0: all are kept.
  std::uint64_t keep_bytes = 0;
};

// Reads a recording, compressed or not, in constant memory; "-" is the standard input. Throws Error:
// open, permission, data for a file that is not a recording. docs/recordings.md has an example.
R4LINK_API void read_recording(const std::string& path, RecordingVisitor& visitor);

class R4LINK_API Recording {
 public:
  // Opens the file, whose name ends in .zst where it is to be compressed; a recording that is there goes on at
  // its end. Throws Error: open, permission, data for a file that holds something else, usage for wrong options.
  explicit Recording(const std::string& path, RecordingOptions options = {});
  // Does what close() does.
  ~Recording();
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;

  // Writes what waits and ends the file: waits for the disk. Boards may still record; that is left out. Any
  // thread; idempotent.
  void close();

  // Why it has ended before it was closed. Kind `data`: it goes on, but the file was removed or truncated, and what was in
  // it is lost. Nothing if neither has happened.
  std::optional<Problem> problem() const;
  // Datagrams and events so far, and those that the disk was too slow for.
  std::uint64_t records() const;
  std::uint64_t dropped() const;

 private:
  friend class AsyncBoard;
  std::shared_ptr<Recorder> recorder_;
};

}  // namespace r4
