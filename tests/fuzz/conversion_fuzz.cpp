// SPDX-License-Identifier: GPL-3.0-or-later
// Whatever a file holds, reading it as a log of frames, a capture or an MCAP file ends, crashes nothing, and gives the
// same however the bytes come; and what was read comes back byte by byte from the formats that hold all of it.
#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "input.hpp"
#include "r4link/error.hpp"
#include "tools/r4/recording/formats.hpp"

namespace r4 {
namespace {

struct Made final : tool::Output {
  void write(std::string_view written) override { file += written; }
  std::string file;
  std::string told;  // of damage, and why it was refused
};

// As `r4 convert` makes it, of bytes that come in pieces of that size.
Made converted(std::string_view bytes, const char* from, const char* to, std::size_t piece) {
  Made made;
  try {
    const std::unique_ptr<tool::Sink> sink = tool::make_sink(to, made);
    tool::Conversion conversion(*sink, [&made](const RecordingDamage& each) {
      made.told += std::to_string(each.line) + ' ' + std::to_string(each.offset) + ' ';
      made.told += each.reason;
      made.told += '\n';
    });
    const std::unique_ptr<tool::Source> source = tool::make_source(from, conversion);
    for (; !bytes.empty(); bytes.remove_prefix(std::min(piece, bytes.size()))) {
      source->feed(bytes.substr(0, piece));
    }
    source->finish();
    conversion.finish();
  } catch (const Error& error) {
    made.file.clear();
    made.told += error.what();
  }
  return made;
}

}  // namespace
}  // namespace r4

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using r4::converted;
  constexpr std::array<const char*, 3> formats{"x.log", "x.pcapng", "x.mcap"};
  constexpr const char* native = "x.r4log";
  if (size < 2) return 0;
  const char* const from = formats[data[0] % formats.size()];
  const std::string_view bytes(reinterpret_cast<const char*>(data) + 2, size - 2);
  const r4::Made whole = converted(bytes, from, native, size);
  const r4::Made cut = converted(bytes, from, native, 1 + data[1]);
  r4::require(whole.file == cut.file && whole.told == cut.told);
  if (whole.file.empty()) return 0;
  for (const char* const by : {"x.pcapng", "x.mcap"}) {
    const r4::Made there = converted(whole.file, native, by, whole.file.size());
    if (there.file.empty()) continue;  // a time that MCAP cannot write
    const r4::Made back = converted(there.file, by, native, there.file.size());
    r4::require(back.file == whole.file && back.told.empty());
  }
  return 0;
}
