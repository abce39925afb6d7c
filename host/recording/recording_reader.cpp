// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/recordings/recording_reader.hpp"

#include <algorithm>
#include <utility>

#include "r4link/error.hpp"
#include "r4link/recordings/file_form.hpp"

namespace r4 {
namespace {

constexpr std::size_t magic_size = 4;  // of zstd

bool complete(std::string& beginning, std::string_view& bytes, std::size_t wanted) {
  const std::size_t taken = std::min(bytes.size(), wanted - beginning.size());
  beginning += bytes.substr(0, taken);
  bytes.remove_prefix(taken);
  return beginning.size() == wanted;
}

}  // namespace

std::string to_text(const RecordingDamage& damage) {
  const std::string line = damage.line == 0 ? "" : "line " + std::to_string(damage.line) + ", ";
  return line + "byte " + std::to_string(damage.offset) + ": " + std::string(damage.reason);
}

const char* RecordingLines::on_line(std::string_view line, std::uint32_t stream) {
  // In a record CR is written as \xNN, so this CR belongs to the line's end.
  while (line.ends_with('\r')) line.remove_suffix(1);
  if (line.empty()) return nullptr;
  // Another file format may carry any bytes as one line.
  const bool one = !line.starts_with('#') || line.find('\n') == std::string_view::npos;
  if (!one || !read_record_line(line, read_)) {
    on_damage();
    return one ? read_.problem : "the text contains the end of a line";
  }
  if (line == damage_line) damage_ = Damage::reported;
  const bool header = read_.kind == LineKind::header;
  if (header ? after_header_ : stream_.value_or(stream) != stream) on_sign_of_mixture();
  after_header_ = header;
  stream_ = stream;
  switch (read_.kind) {
    case LineKind::damaged:
      break;
    case LineKind::record:
      recognised_ = true;
      give(read_.record);
      return nullptr;
    case LineKind::header:
      if (read_.version != record_version) {
        throw Error(ErrorKind::data, name_,
                    std::string("the recording has a later version: ").append(line.substr(0, 60)),
                    "read the recording with a newer r4");
      }
      recognised_ = true;
      ended_ = false;
      damage_ = Damage::none;
      paths_.clear();
      visitor_.on_header();
      break;
    case LineKind::path: {
      Path& path = paths_[read_.path.number];
      if (!path.url.empty() && path.url != read_.path.url) on_sign_of_mixture();
      path = {read_.path.url, std::nullopt};
      visitor_.on_path(read_.path);
      return nullptr;
    }
    case LineKind::device:
      visitor_.on_device(read_.device);
      break;
    case LineKind::comment:
      break;
  }
  visitor_.on_comment(line);
  return nullptr;
}

void RecordingLines::on_record(const Record& record, std::uint32_t stream, std::string_view url) {
  Path& path = paths_[record.path];
  if (path.stream.value_or(stream) != stream) on_sign_of_mixture();
  if (!path.url.empty() && !url.empty() && path.url != url) on_sign_of_mixture();
  path.stream = stream;
  give(record);
}

void RecordingLines::give(const Record& record) {
  if (ended_) on_sign_of_mixture();
  after_header_ = false;
  ended_ = record.path == no_path && record.kind == RecordKind::event && record.bytes == "end";
  visitor_.on_record(record);
}

void RecordingLines::on_sign_of_mixture() {
  if (damage_ == Damage::none) {
    throw Error(ErrorKind::data, name_,
                "several recordings are mixed, so the board of each datagram is unknown",
                "read each recording alone, or join them one after the other: cat A.r4log B.r4log");
  }
  if (damage_ == Damage::here) visitor_.on_comment(damage_line);
  damage_ = Damage::reported;
}

RecordingReader::RecordingReader(RecordingVisitor& visitor, std::string name)
    : lines_(visitor, name), visitor_(visitor), name_(std::move(name)) {
  part_.reserve(max_record_line + 1);
}

void RecordingReader::feed(std::string_view bytes) {
  if (beginning_.size() < magic_size) {
    if (!complete(beginning_, bytes, magic_size)) return;
    if (is_zstd(beginning_)) zstd_ = std::make_unique<ZstdReader>();
    feed(beginning_);
  }
  zstd_ ? on_compressed(bytes) : on_text(bytes);
}

void RecordingReader::on_compressed(std::string_view bytes) {
  for (;;) {
    const std::size_t before = bytes.size();
    const ZstdReader::Step step = zstd_->step(bytes);
    if (step == ZstdReader::Step::damaged) {
      // The text after the damage does not continue this line.
      if (part_size_ != 0) end_line({});
      if (zstd_->window_too_large() && !lines_.recognised()) {
        throw Error(ErrorKind::data, name_, ZstdReader::window_problem,
                    "unpack the file first: zstd -d --long=31 FILE.zst");
      }
      lines_.on_damage();
      visitor_.on_damage({RecordingDamage::Kind::zstd, line_, taken_, zstd_->problem()});
    }
    taken_ += before - bytes.size();
    if (step == ZstdReader::Step::more) break;
    if (step == ZstdReader::Step::text) on_text(zstd_->text());
  }
  if (!lines_.recognised() && taken_ > patience) fail_as_none();
}

void RecordingReader::on_text(std::string_view text) {
  if (text_beginning_.size() < form_bytes) {
    if (!complete(text_beginning_, text, form_bytes)) return;
    if (form_of(text_beginning_) != FileForm::text) fail_as_none();
    std::string_view beginning = text_beginning_;
    if (beginning.starts_with(utf8_mark)) {
      beginning.remove_prefix(utf8_mark.size());
      offset_ = utf8_mark.size();
    }
    on_lines(beginning);
  }
  on_lines(text);
}

void RecordingReader::on_lines(std::string_view text) {
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    const std::string_view piece = text.substr(0, end);
    if (end == std::string_view::npos) {
      part_size_ += piece.size();
      part_ += piece.substr(0, max_record_line + 1 - std::min(part_.size(), max_record_line + 1));
      text = {};
    } else {
      end_line(piece);
      text.remove_prefix(end + 1);
    }
    if (!lines_.recognised() && offset_ + part_size_ > patience) fail_as_none();
  }
}

void RecordingReader::end_line(std::string_view rest) {
  const std::uint64_t size = part_size_ + rest.size();
  const bool cr = rest.empty() ? part_.ends_with('\r') : rest.ends_with('\r');
  if (size > max_record_line + (cr ? 1 : 0)) {
    damage(RecordingDamage::Kind::line, "the line is longer than a line of a recording can be");
  } else {
    if (part_size_ != 0) part_ += rest;
    const char* const problem = lines_.on_line(part_size_ == 0 ? rest : part_);
    if (problem != nullptr) damage(RecordingDamage::Kind::line, problem);
  }
  part_.clear();
  part_size_ = 0;
  offset_ += size + 1;
  ++line_;
}

void RecordingReader::finish() {
  if (beginning_.size() < magic_size) on_text(beginning_);
  if (text_beginning_.size() < form_bytes) on_lines(text_beginning_);
  const bool recognised = lines_.recognised();
  if (part_size_ != 0) {
    damage(RecordingDamage::Kind::torn, "the last line is not complete");
  } else if (recognised && zstd_ && !zstd_->between_frames()) {
    damage(RecordingDamage::Kind::torn, "the recording was not ended");
  }
  if (!recognised) fail_as_none();
}

void RecordingReader::damage(RecordingDamage::Kind kind, std::string_view reason) {
  lines_.on_damage();
  visitor_.on_damage({kind, line_, offset_, reason});
}

void RecordingReader::fail_as_none() const {
  throw not_a_recording(name_, form_of(text_beginning_));
}

}  // namespace r4
