// SPDX-License-Identifier: GPL-3.0-or-later
#include "recording_reader.hpp"

#include <algorithm>
#include <utility>

#include "r4link/error.hpp"

namespace r4 {
namespace {

constexpr std::size_t magic_size = 4;  // of zstd

}  // namespace

RecordingReader::RecordingReader(Handler& handler, std::string name)
    : handler_(handler), name_(std::move(name)) {
  part_.reserve(max_record_line);
}

void RecordingReader::feed(std::string_view bytes) {
  if (begun_) return zstd_ ? on_compressed(bytes) : on_text(bytes);
  const std::size_t taken = std::min(bytes.size(), magic_size - beginning_.size());
  beginning_ += bytes.substr(0, taken);
  bytes.remove_prefix(taken);
  if (beginning_.size() < magic_size) return;
  begun_ = true;
  if (is_zstd(beginning_)) zstd_ = std::make_unique<ZstdReader>();
  feed(beginning_);
  feed(bytes);
}

void RecordingReader::on_compressed(std::string_view bytes) {
  for (;;) {
    const std::size_t before = bytes.size();
    const ZstdReader::Step step = zstd_->step(bytes);
    if (step == ZstdReader::Step::damaged) {
      // What comes next is not the rest of the line that was begun.
      if (part_size_ != 0) end_line({});
      handler_.on_damage({RecordingDamage::Kind::zstd, line_, taken_, "damaged compression"});
    }
    taken_ += before - bytes.size();
    if (step == ZstdReader::Step::more) break;
    if (step == ZstdReader::Step::text) on_text(zstd_->text());
  }
  if (!recognised_ && taken_ > patience) fail_as_none();
}

void RecordingReader::on_text(std::string_view text) {
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    const std::string_view piece = text.substr(0, end);
    if (end == std::string_view::npos) {
      part_size_ += piece.size();
      part_ += piece.substr(0, max_record_line - std::min(part_.size(), max_record_line));
      text = {};
    } else {
      end_line(piece);
      text.remove_prefix(end + 1);
    }
    if (!recognised_ && offset_ + part_size_ > patience) fail_as_none();
  }
}

// Ends the line whose last bytes these are.
void RecordingReader::end_line(std::string_view rest) {
  const std::uint64_t size = part_size_ + rest.size();
  if (size > max_record_line) {
    damage(RecordingDamage::Kind::line, "longer than any line of a recording");
  } else if (part_size_ == 0) {
    on_line(rest);
  } else {
    part_ += rest;
    on_line(part_);
  }
  part_.clear();
  part_size_ = 0;
  offset_ += size + 1;
  ++line_;
}

void RecordingReader::on_line(std::string_view line) {
  if (line.empty()) return;
  read_record_line(line, read_);
  switch (read_.kind) {
    case LineKind::damaged:
      return damage(RecordingDamage::Kind::line, read_.problem);
    case LineKind::record:
      recognised_ = true;
      return handler_.on_record(read_.record);
    case LineKind::header:
      if (read_.version != record_version) {
        throw Error(ErrorKind::data, name_,
                    std::string("a recording of a later version: ").append(line.substr(0, 60)),
                    "read it with a newer r4");
      }
      recognised_ = true;
      handler_.on_header();
      return handler_.on_comment(line);
    case LineKind::wire:
      return handler_.on_wire(read_.wire);
    case LineKind::device:
      handler_.on_device(read_.device);
      return handler_.on_comment(line);
    case LineKind::comment:
      return handler_.on_comment(line);
  }
}

void RecordingReader::finish() {
  if (!begun_) {
    begun_ = true;
    on_text(beginning_);
  }
  if (part_size_ != 0) {
    damage(RecordingDamage::Kind::torn, "the last line is not whole");
  } else if (recognised_ && zstd_ && !zstd_->between_frames()) {
    damage(RecordingDamage::Kind::torn, "the recording was not ended");
  }
  if (!recognised_) fail_as_none();
}

void RecordingReader::damage(RecordingDamage::Kind kind, std::string_view reason) {
  handler_.on_damage({kind, line_, offset_, reason});
}

void RecordingReader::fail_as_none() const {
  throw Error(ErrorKind::data, name_, "no recording", "r4 record URL -o FILE makes one");
}

}  // namespace r4
