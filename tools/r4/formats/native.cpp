// SPDX-License-Identifier: GPL-3.0-or-later
#include "native.hpp"

#include "r4link/recordings/record_line.hpp"

namespace r4::tool {
namespace {

// Bytes of text in a zstd frame: damage costs at most one frame.
constexpr std::size_t frame_text = 1 << 20;

}  // namespace

NativeSink::NativeSink(Output& output, bool compressed) : output_(output) {
  if (compressed) zstd_.emplace();
  text_.reserve(frame_text + max_record_line);
}

void NativeSink::begin() {
  if (begun_) return;
  begun_ = ours_ = true;
  write_record_header(text_);
}

void NativeSink::on_comment(std::string_view line, Time) {
  if (!begun_ && line.starts_with("# r4log ")) begun_ = true;
  begin();
  text_ += line;
  text_ += '\n';
  write_out(false);
}

void NativeSink::on_path(const RecordedPath& path, Time) {
  begin();
  write_path(text_, path);
  write_out(false);
}

void NativeSink::on_record(const Record& record) {
  begin();
  if (ours_ && !told_when_) write_beginning(text_, record.time);
  told_when_ = true;
  time_ = record.time;
  ended_ = record.path == no_path && record.kind == RecordKind::event && record.bytes == "end";
  write_record(text_, record);
  write_out(false);
}

void NativeSink::finish() {
  begin();
  if (ours_ && !ended_) write_record(text_, {time_, no_path, RecordKind::event, "end"});
  write_out(true);
}

void NativeSink::write_out(bool end) {
  if (text_.size() < frame_text && !end) return;
  if (zstd_) {
    compressed_.clear();
    zstd_->write(text_, true, compressed_);
    output_.write(compressed_);
  } else {
    output_.write(text_);
  }
  text_.clear();
}

}  // namespace r4::tool
