// SPDX-License-Identifier: GPL-3.0-or-later
#include "read_file.hpp"

#include <memory>
#include <string_view>

#include "r4link/recordings/recording_reader.hpp"

namespace r4::tool {

void read_file(const std::string& path, RecordingVisitor& visitor, const SourceOptions& options,
               const std::function<void(std::size_t)>& advance) {
  const std::unique_ptr<Source> source = make_source(path, visitor, options);
  read_in_pieces(path, [&](std::string_view piece) {
    source->feed(piece);
    if (advance) advance(piece.size());
  });
  source->finish();
}

}  // namespace r4::tool
