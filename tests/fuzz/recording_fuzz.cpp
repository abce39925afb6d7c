// SPDX-License-Identifier: GPL-3.0-or-later
// Any file, read as a recording. Reading ends, does not crash, and has the same result for any cut
// of the bytes. A record that was read reads equal after it is written again. The replay gives the
// datagrams of the board.
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "host/replay/replay_records.hpp"
#include "input.hpp"
#include "r4link/error.hpp"
#include "r4link/recordings/recording_reader.hpp"

namespace r4 {
namespace {

class Lines final : public RecordingVisitor {
 public:
  void on_record(const Record& record) override {
    std::string line;
    write_record(line, record);
    RecordLine again;
    require(line.size() <= max_record_line + 1);
    require(read_record_line(std::string_view(line).substr(0, line.size() - 1), again));
    require(again.kind == LineKind::record && again.record.bytes == record.bytes &&
            again.record.time == record.time && again.record.path == record.path &&
            again.record.kind == record.kind);
    text += line;
    if (!beginning) beginning = record.time;
    const bool played = record.kind == RecordKind::from_board && record.time >= *beginning;
    if (record.path == 1 && played) said.emplace_back(record.bytes);
  }
  void on_path(const RecordedPath& path) override { write_path(text, path); }
  void on_damage(const RecordingDamage& damage) override {
    text += std::to_string(damage.line) + ' ' + std::to_string(damage.offset) + '\n';
  }

  std::string text;
  std::optional<Time> beginning;
  std::vector<std::string> said;  // datagrams of the board on the first path, since the beginning
};

// The text of the records and errors. If damaged data are compressed, the size of the pieces
// decides how much is read.
Lines told(std::string_view bytes, std::size_t piece) {
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
  return lines;
}

// A file with these bytes, removed with the object.
class File {
 public:
  explicit File(std::string_view bytes) : file_(::memfd_create("recording", MFD_CLOEXEC)) {
    require(::write(file_, bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size()));
  }
  ~File() { ::close(file_); }
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  std::string path() const { return "/proc/self/fd/" + std::to_string(file_); }

 private:
  const int file_;
};

// The datagrams that a replay of the first path gives.
std::vector<std::string> played(const std::string& path, const ReplayStart& start) {
  std::vector<std::string> said;
  try {
    ReplayRecords records(path, path, 1, start);
    do {
      while (records.next() != nullptr) {
        const ReplayRecords::Item item = records.take();
        require(item.kind != RecordKind::to_board);
        if (item.kind == RecordKind::from_board) said.push_back(item.bytes);
      }
    } while (records.read_on());
  } catch (const Error&) {
  }
  return said;
}

}  // namespace
}  // namespace r4

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string_view bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  const r4::Lines whole = r4::told(bytes, size);
  const r4::Lines cut = r4::told(bytes, 1 + data[0]);
  if (!r4::is_zstd(bytes)) r4::require(whole.text == cut.text);
  const r4::File file(bytes);
  const std::vector<std::string> played = r4::played(file.path(), {});
  // A record of another version ends the reading and the replay. The replay may end without playing
  // the earlier records.
  r4::require(played.empty() || played == whole.said);
  const std::vector<std::string> later =
      r4::played(file.path(), {.time = r4::Time(data[0] * 100'000)});
  r4::require(later.size() <= whole.said.size());
  return 0;
}
