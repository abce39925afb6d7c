// SPDX-License-Identifier: GPL-3.0-or-later
// The native format, .r4log and .r4log.zst (docs/how-to/recordings.md), as a source and a sink.
#pragma once

#include <optional>
#include <string>

#include "conversion.hpp"
#include "r4link/recordings/recording_reader.hpp"
#include "r4link/recordings/zstd_stream.hpp"

namespace r4::tool {

class NativeSource final : public Source {
 public:
  NativeSource(RecordingVisitor& visitor, std::string name) : reader_(visitor, std::move(name)) {}
  void feed(std::string_view bytes) override { reader_.feed(bytes); }
  void finish() override { reader_.finish(); }

 private:
  RecordingReader reader_;
};

// Writes lines unchanged. Data from another format gets its own header and end.
class NativeSink final : public Sink {
 public:
  NativeSink(Output& output, bool compressed);
  void on_comment(std::string_view line, Time time) override;
  void on_path(const RecordedPath& path, Time time) override;
  void on_record(const Record& record) override;
  void finish() override;

 private:
  void begin();
  void write_out(bool end);

  Output& output_;
  std::optional<ZstdWriter> zstd_;
  bool begun_ = false;
  bool ours_ = false;       // the header is r4's own
  bool told_when_ = false;  // the start time has been written
  bool ended_ = false;
  Time time_{0};
  std::string text_, compressed_;
};

}  // namespace r4::tool
