// SPDX-License-Identifier: GPL-3.0-or-later
#include "recording_writer.hpp"

#include <fmt/format.h>

#include <utility>

#include "r4link/recordings/record_line.hpp"

namespace r4 {
namespace {

// Limit of waiting text in bytes.
constexpr std::size_t most_text = 65536;
// Bytes of text in one frame. If the frame's beginning is damaged, the whole frame is lost.
constexpr std::size_t frame_text = 1 << 20;

}  // namespace

RecordingWriter::RecordingWriter(const std::string& path, const RecordingOptions& options)
    : options_(options), parts_(path, options) {
  text_.reserve(most_text + max_record_line);
  begin_file();
}

void RecordingWriter::begin_file() {
  parts_.make_room();
  path_ = parts_.next();
  file_.emplace(path_);
  zstd_.reset();
  if (path_.ends_with(".zst")) zstd_.emplace();
  frame_ = 0;
  begun_.reset();
  // Ends the last line, which an earlier writer left incomplete.
  if (file_->torn()) text_ += '\n';
  write_record_header(text_);
  for (const auto& [number, path] : paths_) write_path(text_, path);
  for (const RecordedDevice& device : devices_) write_device(text_, device);
}

void RecordingWriter::declare(const RecordedPath& path) {
  paths_[path.number] = path;
  write_path(text_, path);
}

void RecordingWriter::declare(const RecordedDevice& device) {
  std::erase_if(devices_, [&](const RecordedDevice& each) {
    return each.path == device.path && each.place == device.place;
  });
  devices_.push_back(device);
  write_device(text_, device);
}

bool RecordingWriter::is_due(Time time) const {
  if (!begun_) return false;
  if (options_.rotate_after.count() != 0 && time - *begun_ >= options_.rotate_after) return true;
  return parts_.most_bytes() != 0 &&
         file_->size() + (zstd_ ? 0 : text_.size()) >= parts_.most_bytes();
}

void RecordingWriter::append(const Record& record) {
  if (is_due(record.time)) {
    close();
    begin_file();
  }
  if (!begun_) {
    begun_ = record.time;
    write_beginning(text_, record.time);
  }
  write_record(text_, without_secrets(record, room_));
  if (text_.size() >= most_text) write_out(false);
}

void RecordingWriter::flush() {
  look_after_file();
  write_out(false);
}

void RecordingWriter::close() {
  look_after_file();
  write_out(true);
}

// Completes a moved file (logrotate). A removed or truncated file is lost.
void RecordingWriter::look_after_file() {
  using Fate = RecordingFile::Fate;
  const Fate fate = file_->fate();
  if (fate == Fate::here) return;
  const bool moved = fate == Fate::moved;
  if (moved) write_out(true);
  const char* const what = moved ? "moved" : fate == Fate::removed ? "removed" : "truncated";
  trouble_ = {moved ? ErrorKind::open : ErrorKind::data, path_,
              fmt::format("was {} during recording, so r4 has started a new file{}", what,
                          moved ? "" : "; the earlier records are lost"),
              "let r4 record start new files and remove old files: --rotate, --keep"};
  const std::string waiting = std::exchange(text_, {});
  begin_file();
  text_ += waiting;
}

void RecordingWriter::write_out(bool end_frame) {
  if (!zstd_) {
    if (!text_.empty()) file_->append(text_);
  } else if (!text_.empty() || (end_frame && frame_ != 0)) {
    frame_ += text_.size();
    if (frame_ >= frame_text) end_frame = true;
    compressed_.clear();
    zstd_->write(text_, end_frame, compressed_);
    file_->append(compressed_);
    if (end_frame) frame_ = 0;
  }
  text_.clear();
}

}  // namespace r4
