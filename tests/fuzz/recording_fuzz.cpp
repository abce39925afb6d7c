// SPDX-License-Identifier: GPL-3.0-or-later
// Whatever a file holds, reading it as a recording ends, crashes nothing, and gives the same however the bytes come;
// a record that was read is written and read again as it was.
#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>

#include "host/recording/recording_reader.hpp"
#include "input.hpp"
#include "r4link/error.hpp"

namespace r4 {
namespace {

class Lines final : public RecordingReader::Handler {
 public:
  void on_record(const Record& record) override {
    std::string line;
    write_record(line, record);
    RecordLine again;
    require(line.size() <= max_record_line + 1);
    require(read_record_line(std::string_view(line).substr(0, line.size() - 1), again));
    require(again.kind == LineKind::record && again.record.bytes == record.bytes &&
            again.record.time == record.time && again.record.wire == record.wire &&
            again.record.kind == record.kind);
    text += line;
  }
  void on_wire(const RecordedWire& wire) override { write_wire(text, wire); }
  void on_damage(const RecordingDamage& damage) override {
    text += std::to_string(damage.line) + ' ' + std::to_string(damage.offset) + '\n';
  }

  std::string text;
};

// What is told of it. Of compression that is damaged, how much is read depends on the pieces.
std::string told(std::string_view bytes, std::size_t piece) {
  Lines lines;
  try {
    RecordingReader reader(lines, "input");
    while (!bytes.empty()) {
      reader.feed(bytes.substr(0, piece));
      bytes.remove_prefix(std::min(piece, bytes.size()));
    }
    reader.finish();
  } catch (const Error& error) {
    lines.text += error.what();
  }
  return lines.text;
}

}  // namespace
}  // namespace r4

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string_view bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  const std::string whole = r4::told(bytes, size);
  const std::string cut = r4::told(bytes, 1 + data[0]);
  if (!r4::is_zstd(bytes)) r4::require(whole == cut);
  return 0;
}
