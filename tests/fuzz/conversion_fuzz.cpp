// SPDX-License-Identifier: GPL-3.0-or-later
// Any file, read as a recording, a log of frames, a capture or an MCAP file. Reading ends, does not
// crash, and has the same result for any cut of the bytes. The formats that hold a whole recording
// return its records byte for byte. The other formats are well-formed, and the summary of `r4 info`
// counts the same records.
#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "input.hpp"
#include "r4link/devices/description.hpp"
#include "r4link/error.hpp"
#include "r4link/recordings/zstd_stream.hpp"
#include "tools/r4/recording/formats.hpp"
#include "tools/r4/recording/recording_summary.hpp"

namespace r4 {

// A recording contains the texts of its devices, so no file is needed here.
DeviceDescription DeviceDescription::load(const std::string& name) {
  throw Error(ErrorKind::open, name, "there are no files here", "");
}

namespace {

struct Made final : tool::Output {
  void write(std::string_view written) override { file += written; }
  std::string file;
  std::string told;  // the damage, and the error
  std::uint64_t records = 0;
};

constexpr const char* native = "x.r4log";

void read(std::string_view bytes, const char* from, std::size_t piece, RecordingVisitor& handler) {
  const std::unique_ptr<tool::Source> source = tool::make_source(from, handler);
  for (; !bytes.empty(); bytes.remove_prefix(std::min(piece, bytes.size()))) {
    source->feed(bytes.substr(0, piece));
  }
  source->finish();
}

// Converts as `r4 convert` does, with the bytes in pieces of that size.
Made converted(std::string_view bytes, const char* from, const char* to, std::size_t piece) {
  Made made;
  try {
    const std::unique_ptr<tool::Sink> sink = tool::make_sink(to, made);
    tool::Conversion conversion(*sink, [&made](const RecordingDamage& each) {
      made.told += std::to_string(each.line) + ' ' + std::to_string(each.offset) + ' ';
      made.told += each.reason;
      made.told += '\n';
    });
    if (sink->wants_survey()) {
      tool::Survey survey(*sink);
      read(bytes, from, piece, survey);
    }
    read(bytes, from, piece, conversion);
    conversion.finish();
    made.records = conversion.records();
  } catch (const Error& error) {
    made.file.clear();
    made.told += error.what();
  }
  return made;
}

Made converted(const Made& recording, const char* to) {
  return converted(recording.file, native, to, recording.file.size());
}

void comes_back(const Made& recording, const char* by) {
  const Made there = converted(recording, by);
  if (there.file.empty()) return;  // MCAP cannot write this time
  const Made back = converted(there.file, by, native, there.file.size());
  require(back.file == recording.file && back.told.empty());
}

// Requires a table: every row has the same number of columns.
void is_csv(std::string_view text) {
  std::size_t columns = 0, in_header = 0;
  bool quoted = false;
  for (const char c : text) {
    if (c == '"') quoted = !quoted;
    if (quoted) continue;
    if (c == ',' || c == '\n') ++columns;
    if (c != '\n') continue;
    if (in_header == 0) in_header = columns;
    require(columns == in_header);
    columns = 0;
  }
  require(!quoted && in_header >= 5 && text.ends_with('\n'));
}

void is_json_lines(std::string_view text, std::uint64_t records) {
  for (; !text.empty(); --records) {
    const std::size_t end = text.find('\n');
    require(end != std::string_view::npos && records != 0);
    require(tool::Json::parse(text.substr(0, end), nullptr, false).is_object());
    text.remove_prefix(end + 1);
  }
  require(records == 0);
}

void is_told_of(const Made& recording, std::uint64_t records) {
  tool::RecordingSummary summary;
  read(recording.file, native, recording.file.size(), summary);
  require(!summary.damaged() && !summary.text("x").empty());
  const tool::Json object = tool::Json::parse(tool::line_of(summary.json("x")), nullptr, false);
  require(object["records"] == records);
}

}  // namespace
}  // namespace r4

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using r4::converted;
  constexpr std::array<const char*, 4> formats{"x.log", "x.pcapng", "x.mcap", r4::native};
  if (size < 2) return 0;
  const char* const from = formats[data[0] % formats.size()];
  const std::string_view bytes(reinterpret_cast<const char*>(data) + 2, size - 2);
  const r4::Made whole = converted(bytes, from, r4::native, size);
  const r4::Made cut = converted(bytes, from, r4::native, 1 + data[1]);
  // If damaged data are compressed, the size of the pieces decides how much is read.
  r4::require(r4::is_zstd(bytes) || (whole.file == cut.file && whole.told == cut.told));
  if (whole.file.empty()) return 0;
  r4::comes_back(whole, "x.pcapng");
  r4::comes_back(whole, "x.mcap");
  r4::is_csv(converted(whole, "x.csv").file);
  const r4::Made lines = converted(whole, "x.jsonl");
  r4::is_json_lines(lines.file, lines.records);
  const r4::Made frames = converted(whole, "x.log");
  if (!frames.file.empty()) {
    const r4::Made back = converted(frames.file, "x.log", r4::native, frames.file.size());
    r4::require(back.told.empty() || back.told.find("count from 1970") != std::string::npos);
  }
  r4::is_told_of(whole, lines.records);
  return 0;
}
