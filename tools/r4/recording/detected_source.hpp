// SPDX-License-Identifier: GPL-3.0-or-later
// A file of whatever form, told by what it holds: a native recording, a log of candump, a capture or an MCAP file; each
// also compressed by zstd. Its name decides only where nothing in its first 64 KiB does.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "formats.hpp"
#include "r4link/recordings/zstd_stream.hpp"

namespace r4::tool {

class DetectedSource final : public Source {
 public:
  DetectedSource(RecordingVisitor& visitor, std::string name, const SourceOptions& options)
      : visitor_(visitor), name_(std::move(name)), options_(options) {}
  // Throws Error{data} for a form that is not read.
  void feed(std::string_view bytes) override;
  void finish() override;

 private:
  enum class Format : std::uint8_t { native, candump, packets, mcap };
  void take_compressed(std::string_view bytes);
  void take(std::string_view text);
  std::optional<Format> detect(bool at_end);
  Format named() const;
  void decide(Format format);

  RecordingVisitor& visitor_;
  const std::string name_;
  const SourceOptions options_;
  std::unique_ptr<Source> source_;    // once the format is known
  std::string file_;                  // what has come until then
  std::string text_;                  // the same, not compressed
  std::size_t looked_at_ = 0;         // of the text
  std::unique_ptr<ZstdReader> zstd_;  // unless the source does it
  std::uint64_t taken_ = 0;           // bytes of the file that zstd_ has had
  RecordLine line_;
};

}  // namespace r4::tool
