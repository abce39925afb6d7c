// SPDX-License-Identifier: GPL-3.0-or-later
#include "detected_source.hpp"

#include <algorithm>
#include <utility>

#include "../formats/candump_log.hpp"
#include "../formats/mcap/mcap_source.hpp"
#include "../formats/native.hpp"
#include "../formats/packets/pcap_source.hpp"
#include "r4link/error.hpp"
#include "r4link/recordings/file_form.hpp"

namespace r4::tool {
namespace {

// Bytes of text searched for a line of a known format.
constexpr std::size_t patience = 65536;
// Limit on the stored beginning of a file: a skippable zstd frame may have any length.
constexpr std::size_t most_kept = 1 << 20;

}  // namespace

void DetectedSource::feed(std::string_view bytes) {
  if (source_ && !zstd_) return source_->feed(bytes);
  if (!source_) file_ += bytes;
  if (zstd_) return take_compressed(bytes);
  if (file_.size() < form_bytes) return;
  if (is_zstd(file_)) {
    zstd_ = std::make_unique<ZstdReader>();
    const std::string beginning = file_;
    take_compressed(beginning);
  } else {
    take(text_.empty() ? std::string_view(file_) : bytes);
  }
}

void DetectedSource::finish() {
  if (!source_) {
    if (!zstd_ && text_.empty()) text_ = file_;
    decide(detect(true).value_or(named()));
  }
  if (zstd_ && !zstd_->between_frames()) {
    visitor_.on_damage(
        {RecordingDamage::Kind::torn, 0, taken_, "the end of the compressed data is missing"});
  }
  source_->finish();
}

// Keeps the file until its format is known. A native recording is then read from its beginning,
// because damaged compression is reported with line numbers.
void DetectedSource::take_compressed(std::string_view bytes) {
  while (zstd_) {
    const std::size_t before = bytes.size();
    const ZstdReader::Step step = zstd_->step(bytes);
    const std::uint64_t at = taken_;
    taken_ += before - bytes.size();
    if (step == ZstdReader::Step::more) {
      if (!source_ && file_.size() > most_kept) decide(named());
      return;
    }
    if (step == ZstdReader::Step::text) {
      take(zstd_->text());
    } else if (source_) {
      visitor_.on_damage({RecordingDamage::Kind::zstd, 0, at, zstd_->problem()});
    } else {
      decide(Format::native);
    }
  }
}

void DetectedSource::take(std::string_view text) {
  if (source_) return source_->feed(text);
  text_ += text;
  if (const std::optional<Format> format = detect(false)) decide(*format);
}

std::optional<DetectedSource::Format> DetectedSource::detect(bool at_end) {
  if (text_.size() < form_bytes && !at_end) return std::nullopt;
  const FileForm form = form_of(text_);
  switch (form) {
    case FileForm::pcap:
      return Format::packets;
    case FileForm::mcap:
      return Format::mcap;
    case FileForm::text:
      break;
    default:
      throw not_a_recording(name_, form);
  }
  const std::string_view text = std::string_view(text_).substr(0, patience);
  while (looked_at_ < text.size()) {
    const std::size_t end = text.find('\n', looked_at_);
    if (end == std::string_view::npos && !at_end && text.size() < patience) return std::nullopt;
    std::string_view line = text.substr(looked_at_, end - looked_at_);
    if (looked_at_ == 0 && line.starts_with(utf8_mark)) line.remove_prefix(utf8_mark.size());
    looked_at_ = end == std::string_view::npos ? text.size() : end + 1;
    if (line.ends_with('\r')) line.remove_suffix(1);
    if (read_record_line(line, line_) &&
        (line_.kind == LineKind::record || line_.kind == LineKind::header)) {
      return Format::native;
    }
    if (CandumpSource::recognises(line)) return Format::candump;
  }
  return text.size() == patience ? std::optional(named()) : std::nullopt;
}

// Decides by the file's name, so that errors refer to the format that the user expects.
DetectedSource::Format DetectedSource::named() const {
  const std::string_view name = name_;
  if (name.ends_with(".log")) return Format::candump;
  if (name.ends_with(".mcap")) return Format::mcap;
  return name.ends_with(".pcapng") || name.ends_with(".pcap") ? Format::packets : Format::native;
}

void DetectedSource::decide(Format format) {
  switch (format) {
    case Format::native:
      source_ = std::make_unique<NativeSource>(visitor_, name_);
      break;
    case Format::candump:
      source_ = std::make_unique<CandumpSource>(visitor_, name_, options_.start);
      break;
    case Format::packets:
      source_ = std::make_unique<PcapSource>(visitor_, name_, options_.port);
      break;
    case Format::mcap:
      source_ = std::make_unique<McapSource>(visitor_, name_);
      break;
  }
  if (format == Format::native) zstd_.reset();
  const std::string waiting = std::move(zstd_ ? text_ : file_);
  file_ = {};
  text_ = {};
  source_->feed(waiting);
}

}  // namespace r4::tool
