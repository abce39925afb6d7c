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
#include <string_view>

#include "config.hpp"
#include "devices/device.hpp"
#include "error.hpp"
#include "link.hpp"

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

// What read_recording() finds, in the order of the file. Times are microseconds since 1970 (UTC); what is handed over
// is valid within the call.
class RecordingVisitor {
 public:
  virtual ~RecordingVisitor() = default;
  // A recording begins, or another one in the same file: its paths and devices may be others.
  virtual void on_beginning() {}
  // How a board is reached, before the first record of that path, and again when its name is known: its own or its id.
  virtual void on_path(int path, const std::string& url, const std::string& name) {
    static_cast<void>(path), static_cast<void>(url), static_cast<void>(name);
  }
  // A described device of that path's board, from now on: device.readings(state) is what it has measured.
  virtual void on_device(int path, const Device& device) {
    static_cast<void>(path), static_cast<void>(device);
  }
  // A state, whose fields are merged over those before.
  virtual void on_state(int path, Time at, const State& state) {
    static_cast<void>(path), static_cast<void>(at), static_cast<void>(state);
  }
  // Every datagram, also of states and damaged ones.
  virtual void on_datagram(int path, Time at, bool from_board, std::string_view bytes) {
    static_cast<void>(path), static_cast<void>(at), static_cast<void>(from_board),
        static_cast<void>(bytes);
  }
  // "up udp://192.168.0.125", "link safe stop": docs/recordings.md. Path 0 is the recording itself.
  virtual void on_event(int path, Time at, std::string_view words) {
    static_cast<void>(path), static_cast<void>(at), static_cast<void>(words);
  }
  // A place that cannot be read, or a description, in words; what is behind it is read again.
  virtual void on_damage(const std::string& words) { static_cast<void>(words); }
};

// Reads a recording, compressed or not; "-" is the standard input. In constant memory, however long it is. Throws
// Error: open, permission, data for what is none.
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
