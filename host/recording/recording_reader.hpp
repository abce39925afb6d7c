// SPDX-License-Identifier: GPL-3.0-or-later
// Reads a recording in pieces, in constant memory, however long and however damaged it is: what can be read
// is read, and the rest is told with its place.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "record_line.hpp"
#include "zstd_stream.hpp"

namespace r4 {

// Something in a recording that cannot be read.
struct RecordingDamage {
  enum class Kind : std::uint8_t {
    line,  // no line of a recording
    torn,  // the last line has no end: whoever wrote it was ended there
    zstd,  // a part of a compressed recording; the lines in it are not counted
  };
  Kind kind = Kind::line;
  std::uint64_t line = 1;    // from 1; 0 in a file of another format, which has none
  std::uint64_t offset = 0;  // of its first byte: in the text; for zstd in the file
  std::string_view reason;
};

class RecordingReader {
 public:
  // The views are valid within the call.
  class Handler {
   public:
    virtual void on_record(const Record& record) = 0;
    // Comes before the first record of that wire, and again when more is known of it. Behind a new header wires
    // may be others than before.
    virtual void on_wire(const RecordedWire& wire) = 0;
    virtual void on_damage(const RecordingDamage& damage) = 0;
    // What is at that place of that wire from now on, until a header.
    virtual void on_device(const RecordedDevice& device) { static_cast<void>(device); }
    // A recording begins here, or goes on: one file may hold several.
    virtual void on_header() {}
    // Another line that begins with #; behind on_header() and on_device() those lines, too.
    virtual void on_comment(std::string_view line) { static_cast<void>(line); }

   protected:
    ~Handler() = default;
  };

  // `name`: what errors are about.
  RecordingReader(Handler& handler, std::string name);

  // Takes the next bytes. Throws Error{data} for a later version of the format, and for what is no
  // recording.
  void feed(std::string_view bytes);
  // The file has ended. Throws Error{data} if it was no recording.
  void finish();

  std::uint64_t lines() const { return line_ - 1; }

 private:
  // How much without a line of a recording makes it none.
  static constexpr std::uint64_t patience = 65536;

  void on_compressed(std::string_view bytes);
  void on_text(std::string_view text);
  void on_line(std::string_view line);
  void end_line(std::string_view rest);
  void damage(RecordingDamage::Kind kind, std::string_view reason);
  [[noreturn]] void fail_as_none() const;

  Handler& handler_;
  const std::string name_;
  std::unique_ptr<ZstdReader> zstd_;
  std::string beginning_;        // of the file, until it is known whether it is compressed
  bool begun_ = false;           // it is
  bool recognised_ = false;      // it is a recording
  std::uint64_t taken_ = 0;      // bytes of the file
  std::uint64_t line_ = 1;       // the number of the line that comes
  std::uint64_t offset_ = 0;     // where it begins in the text
  std::string part_;             // of a line whose end has not come
  std::uint64_t part_size_ = 0;  // of all of it; more than part_ holds where it is too long
  RecordLine read_;
};

// Reads the file of that name, "-" being the standard input. Throws Error if it cannot be read, or is no
// recording.
void read_recording(const std::string& path, RecordingReader::Handler& handler);

}  // namespace r4
