// SPDX-License-Identifier: GPL-3.0-or-later
#include "read_file.hpp"

#include <memory>
#include <string_view>

#include "host/recording/recording_file.hpp"

namespace r4::tool {

void read_file(const std::string& path, RecordingReader::Handler& handler,
               const SourceOptions& options, const std::function<void(std::size_t)>& advance) {
  const std::unique_ptr<Source> source = make_source(path, handler, options);
  RecordingInput input(path);
  for (std::string_view piece = input.read(); !piece.empty(); piece = input.read()) {
    source->feed(piece);
    if (advance) advance(piece.size());
  }
  source->finish();
}

}  // namespace r4::tool
