// SPDX-License-Identifier: GPL-3.0-or-later
// Reads a recording in pieces, in constant memory. Damage is reported with its place and skipped.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "../config.hpp"
#include "record.hpp"
#include "record_line.hpp"
#include "recording_visitor.hpp"
#include "zstd_stream.hpp"

namespace r4 {

// Reads the lines of the native format, in a file of any format. Successive recordings in one file,
// each after its header, are accepted. Mixed recordings, as from `sort -m`, `mergecap` and `mcap
// merge`, are refused, because their path numbers mean different boards. Signs of a mixture are
// - a header that follows a header, or a record that follows the end of the recording,
// - a path whose URL changes without a header,
// - lines, or datagrams of one path, from another stream (an interface of a capture, a channel of
//   MCAP) without a new header or path.
// If damage may explain a sign, reading continues, and the visitor gets damage_line.
class R4LINK_API RecordingLines {
 public:
  static constexpr std::string_view damage_line = "# damage: a part before this could not be read";

  // `name`: the subject of errors.
  RecordingLines(RecordingVisitor& visitor, std::string name)
      : visitor_(visitor), name_(std::move(name)) {}

  // Passes the content of a line to the visitor. Returns nullptr, or why the line is not a line of
  // a recording. Throws Error{data} for a later version of the format, and for mixed recordings.
  const char* on_line(std::string_view line, std::uint32_t stream = 0);
  // Passes a record that is not a line to the visitor. `stream`: the stream of the record. `url`:
  // the board's URL in the stream; may be empty. Throws Error{data} for mixed recordings.
  void on_record(const Record& record, std::uint32_t stream, std::string_view url);

  // A sign of a mixture. Throws Error{data} unless damage may explain the sign.
  void on_sign_of_mixture();
  // A part of the file could not be read here.
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
  enum class Damage : std::uint8_t { none, here, reported };  // since the newest header
  R4LINK_PRIVATE void give(const Record& record);

  RecordingVisitor& visitor_;
  const std::string name_;
  RecordLine read_;
  bool recognised_ = false;
  bool after_header_ = false;  // the last line was the header
  bool ended_ = false;         // the newest recording has ended
  Damage damage_ = Damage::none;
  std::optional<std::uint32_t> stream_;  // stream of the lines since the newest header
  std::map<std::uint16_t, Path> paths_;
};

class R4LINK_API RecordingReader {
 public:
  RecordingReader(RecordingVisitor& visitor, std::string name);

  // Reads the next bytes. Lines may end in CR LF, and the UTF-8 mark may precede the first line.
  // Throws Error{data} for a later version of the format, mixed recordings, and other files.
  void feed(std::string_view bytes);
  // The file has ended. Throws Error{data} if the file was not a recording.
  void finish();

 private:
  // A file with this many bytes without a line of a recording is not a recording.
  static constexpr std::uint64_t patience = 65536;

  R4LINK_PRIVATE void on_compressed(std::string_view bytes);
  R4LINK_PRIVATE void on_text(std::string_view text);
  R4LINK_PRIVATE void on_lines(std::string_view text);
  R4LINK_PRIVATE void end_line(std::string_view rest);
  R4LINK_PRIVATE void damage(RecordingDamage::Kind kind, std::string_view reason);
  [[noreturn]] R4LINK_PRIVATE void fail_as_none() const;

  RecordingLines lines_;
  RecordingVisitor& visitor_;
  const std::string name_;
  std::unique_ptr<ZstdReader> zstd_;
  std::string beginning_;        // the first magic_size bytes, which show a compressed file
  std::string text_beginning_;   // the first form_bytes of the text, which show its form
  std::uint64_t taken_ = 0;      // bytes of the file so far
  std::uint64_t line_ = 1;       // the number of the next line
  std::uint64_t offset_ = 0;     // offset of the next line in the text
  std::string part_;             // the beginning of a line whose end has not arrived
  std::uint64_t part_size_ = 0;  // size of this line; larger than part_ if too long
};

// Passes a file to `take` in pieces; "-": standard input. Blocks. Throws Error: open, permission.
R4LINK_API void read_in_pieces(const std::string& path,
                               const std::function<void(std::string_view)>& take);

}  // namespace r4
