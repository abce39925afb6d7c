// SPDX-License-Identifier: GPL-3.0-or-later
// For the tests of recordings: the records that a reader has read, and a full disk.
#pragma once

#include <sys/resource.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "r4link/recordings/recording_reader.hpp"

namespace r4::test {

struct Heard final : RecordingVisitor {
  struct Damage {
    RecordingDamage::Kind kind;
    std::uint64_t line, offset;
    bool operator==(const Damage&) const = default;
  };
  void on_record(const Record& record) override {
    std::string line;
    write_record(line, record);
    records += line;
    ++count;
    if (record.kind == RecordKind::event) events.emplace_back(record.bytes);
  }
  void on_path(const RecordedPath& path) override { paths.push_back(path); }
  void on_device(const RecordedDevice& device) override { devices.push_back(device); }
  void on_damage(const RecordingDamage& each) override {
    damage.push_back({each.kind, each.line, each.offset});
  }
  void on_header() override { ++headers; }

  std::string records;  // one line for each record
  int count = 0;
  int headers = 0;
  std::vector<std::string> events;
  std::vector<RecordedPath> paths;
  std::vector<RecordedDevice> devices;
  std::vector<Damage> damage;
};

// Reads `bytes` in pieces of this size and returns everything that can be read.
inline Heard heard_in(std::string_view bytes, std::size_t piece = 1000) {
  Heard heard;
  RecordingReader reader(heard, "test");
  for (; !bytes.empty(); bytes.remove_prefix(std::min(piece, bytes.size()))) {
    reader.feed(bytes.substr(0, piece));
  }
  reader.finish();
  return heard;
}

// While this object exists, the process can write at most this number of bytes into a file.
struct FileLimit {
  explicit FileLimit(rlim_t bytes) {
    ::getrlimit(RLIMIT_FSIZE, &before);
    rlimit limit = before;
    limit.rlim_cur = bytes;
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileLimit() { ::setrlimit(RLIMIT_FSIZE, &before); }
  FileLimit(const FileLimit&) = delete;
  FileLimit& operator=(const FileLimit&) = delete;
  rlimit before{};
};

}  // namespace r4::test
