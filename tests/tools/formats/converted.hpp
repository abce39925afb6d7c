// SPDX-License-Identifier: GPL-3.0-or-later
// Recordings for tests, and the conversions of the formats.
#pragma once

#include <algorithm>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "r4link/recordings/record_line.hpp"
#include "tests/support/datagrams.hpp"
#include "tools/r4/recording/formats.hpp"

namespace r4::test {

struct StringOutput final : tool::Output {
  void write(std::string_view written) override { bytes += written; }
  std::string bytes;
};

struct Converted {
  std::string bytes;
  std::string left_out;
  struct Damage {
    std::uint64_t line, offset;
    std::string reason;
  };
  std::vector<Damage> damage;
};

// The result of `r4 convert` for the bytes of a file. `from` and `to` are the endings of both
// files. The bytes are read in pieces of this size.
inline Converted converted(std::string_view bytes, const std::string& from, const std::string& to,
                           std::size_t piece = 1000, std::vector<Device> devices = {},
                           const tool::SourceOptions& options = {}) {
  StringOutput output;
  Converted result;
  const std::unique_ptr<tool::Sink> sink = tool::make_sink("test" + to, output, std::move(devices));
  const auto read = [&](RecordingVisitor& handler) {
    const std::unique_ptr<tool::Source> source = tool::make_source("test" + from, handler, options);
    for (std::string_view rest = bytes; !rest.empty();
         rest.remove_prefix(std::min(piece, rest.size()))) {
      source->feed(rest.substr(0, piece));
    }
    source->finish();
  };
  if (sink->wants_survey()) {
    tool::Survey survey(*sink);
    read(survey);
  }
  tool::Conversion conversion(*sink, [&](const RecordingDamage& each) {
    result.damage.push_back({each.line, each.offset, std::string(each.reason)});
  });
  read(conversion);
  conversion.finish();
  result.bytes = std::move(output.bytes);
  result.left_out = sink->left_out();
  return result;
}

// The paper's capture as a recording of one board, in both directions, with the two damaged
// datagrams.
std::string recorded_capture(const std::string& url = "udp://192.168.0.125");

// A recording of this many records of three paths, generated from a seed: datagrams, damaged
// datagrams, random bytes, events, comments, paths that get a name, and times that decrease.
std::string generated_recording(unsigned seed, int records);

}  // namespace r4::test
