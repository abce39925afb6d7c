// SPDX-License-Identifier: GPL-3.0-or-later
// Reads a recording in pieces, in constant memory, however long and however damaged it is: what can be read
// is read, and the rest is told with its place.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "file_form.hpp"
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

// What a recording holds, as it is read. The views are valid within the call.
class RecordingHandler {
 public:
  virtual void on_record(const Record& record) = 0;
  // Comes before the first record of that path, and again when more is known of it. Behind a new header paths
  // may be others than before.
  virtual void on_path(const RecordedPath& path) = 0;
  virtual void on_damage(const RecordingDamage& damage) = 0;
  // What is at that place of that path from now on, until a header.
  virtual void on_device(const RecordedDevice& device) { static_cast<void>(device); }
  // A recording begins here, or goes on: one file may hold several.
  virtual void on_header() {}
  // Another line that begins with #; behind on_header() and on_device() those lines, too.
  virtual void on_comment(std::string_view line) { static_cast<void>(line); }

 protected:
  ~RecordingHandler() = default;
};

// Reads the lines of the native format, in a file of their own or in one of another format.
//
// One file may hold several recordings one after the other, each behind its header. It may not hold several that are
// mixed, as `sort -m`, `mergecap` and `mcap merge` make them: the number of a path means another board in each
// recording, so the states of one board would be told as those of another. Such a file is refused. Its signs are
// - a header that follows a header, or a record that follows the end of the recording,
// - a path whose URL changes without a header,
// - lines, or datagrams of one path, that come from another stream (an interface of a capture, a channel of MCAP)
//   where no header or path begins.
// Where something could not be read before, the missing part may explain such a sign. Then the file is read on, and the
// line damage_line is told, so that a copy of what was read can be read, too.
class RecordingLines {
 public:
  static constexpr std::string_view damage_line = "# damage: a part before this could not be read";

  // `name`: what errors are about.
  RecordingLines(RecordingHandler& handler, std::string name)
      : handler_(handler), name_(std::move(name)) {}

  // Tells what the line says. Returns why it is not a line of a recording, or nullptr. Throws Error{data} for a later
  // version of the format, and for recordings that are mixed.
  const char* on_line(std::string_view line, std::uint32_t stream = 0);
  // Tells a record that a format carries beside the lines, in that stream. `url` is how the stream says that its board
  // is reached; empty if it does not say. Throws Error{data} for recordings that are mixed.
  void on_record(const Record& record, std::uint32_t stream, std::string_view url);

  // Recordings seem to be mixed here. Throws Error{data}, unless damage may explain it.
  void on_sign_of_mixture();
  // Something could not be read here.
  void on_damage() {
    if (damage_ == Damage::none) damage_ = Damage::here;
  }

  // True if a line was a record or a header.
  bool recognised() const { return recognised_; }

 private:
  struct Path {
    std::string url;
    std::optional<std::uint32_t> stream;
  };
  enum class Damage : std::uint8_t { none, here, told };  // since the newest header
  void tell(const Record& record);

  RecordingHandler& handler_;
  const std::string name_;
  RecordLine read_;
  bool recognised_ = false;
  bool after_header_ = false;  // nothing but the header's own line has come
  bool ended_ = false;         // of the newest recording
  Damage damage_ = Damage::none;
  std::optional<std::uint32_t> stream_;  // of the lines, since the newest header
  std::map<std::uint16_t, Path> paths_;
};

class RecordingReader {
 public:
  using Handler = RecordingHandler;

  // `name`: what errors are about.
  RecordingReader(Handler& handler, std::string name);

  // Takes the next bytes. Lines may end in CR LF, and UTF-8's mark may be in front of them. Throws Error{data} for a
  // later version of the format, for recordings that are mixed, and for what is no recording.
  void feed(std::string_view bytes);
  // The file has ended. Throws Error{data} if it was no recording.
  void finish();

  std::uint64_t lines() const { return line_ - 1; }

 private:
  // How much without a line of a recording makes it none.
  static constexpr std::uint64_t patience = 65536;

  void on_compressed(std::string_view bytes);
  void on_text(std::string_view text);
  void on_lines(std::string_view text);
  void end_line(std::string_view rest);
  void damage(RecordingDamage::Kind kind, std::string_view reason);
  [[noreturn]] void fail_as_none() const;

  RecordingLines lines_;
  Handler& handler_;
  const std::string name_;
  std::unique_ptr<ZstdReader> zstd_;
  std::string beginning_;        // of the file, until it is known whether it is compressed
  bool begun_ = false;           // it is
  std::string text_beginning_;   // of the text, until it is known what it is
  bool text_begun_ = false;      // it is
  std::uint64_t taken_ = 0;      // bytes of the file
  std::uint64_t line_ = 1;       // the number of the line that comes
  std::uint64_t offset_ = 0;     // where it begins in the text
  std::string part_;             // of a line whose end has not come
  std::uint64_t part_size_ = 0;  // of all of it; more than part_ holds where it is too long
};

// Reads the file of that name, "-" being the standard input. Throws Error if it cannot be read, or is no
// recording.
void read_recording(const std::string& path, RecordingReader::Handler& handler);

}  // namespace r4
