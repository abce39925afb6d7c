// SPDX-License-Identifier: GPL-3.0-or-later
// Detects a file's format by its content: native recording, candump log, capture or MCAP, each also
// compressed by zstd. If the first 64 KiB do not decide, the name decides.
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
  // Throws Error{data} for a format that cannot be read.
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
  std::unique_ptr<Source> source_;
  std::string file_;  // the file until the format is known
  std::string text_;  // file_, decompressed
  std::size_t looked_at_ = 0;
  std::unique_ptr<ZstdReader> zstd_;  // null if the source decompresses by itself
  std::uint64_t taken_ = 0;
  RecordLine line_;
};

}  // namespace r4::tool
