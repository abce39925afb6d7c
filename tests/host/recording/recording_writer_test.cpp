// SPDX-License-Identifier: GPL-3.0-or-later
// Writes records to files within given limits. The time is the time of the records.
#include "host/recording/recording_writer.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cerrno>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "heard.hpp"
#include "tests/support/datagrams.hpp"
#include "tests/support/problems.hpp"
#include "tests/support/refused_calls.hpp"

namespace r4::test {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

struct RecordingWriterTest : testing::Test {
  RecordingWriterTest() { fs::create_directory(folder); }
  ~RecordingWriterTest() override { fs::remove_all(folder); }

  std::string path(const std::string& name) const { return (folder / name).string(); }
  std::string content(const std::string& name) const {
    std::ifstream file(path(name), std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  std::vector<std::string> names() const {
    std::vector<std::string> found;
    for (const auto& each : fs::directory_iterator(folder)) {
      found.push_back(each.path().filename().string());
    }
    std::sort(found.begin(), found.end());
    return found;
  }
  std::uint64_t size_of_all() const {
    std::uint64_t sum = 0;
    for (const std::string& name : names()) sum += fs::file_size(path(name));
    return sum;
  }
  // Appends a state, 10 ms after the previous state.
  void append(RecordingWriter& writer) {
    const std::string bytes = "AIN24:24.28;OSMC1:" + std::to_string(number * 7919 % 4096) +
                              ",1;PNum:" + std::to_string(number) + ";T:1;^0x0^";
    const Record record{Time{1795468293000000} + number * Time{10ms}, 1, RecordKind::from_board,
                        bytes};
    ++number;
    writer.append(record);
    write_record(all, record);
  }

  const fs::path folder = fs::path(testing::TempDir()) / ("r4-rec-" + std::to_string(::getpid()));
  int number = 0;
  std::string all;  // the lines of all appended records
};

TEST_F(RecordingWriterTest, MasksTheSecretsOfEveryHost) {
  for (const char* name : {"a.r4log", "a.r4log.zst"}) {
    {
      RecordingWriter writer(path(name), {});
      writer.append({Time{1795468293000000}, 1, RecordKind::to_board,
                     with_crc("C:password,letmein!;PNum:1;T:2;")});
      writer.close();
    }
    const std::string records = heard_in(content(name)).records;
    EXPECT_TRUE(records.ends_with("> " + with_crc("C:password,...;PNum:1;T:2;") + "\n")) << records;
  }
}

TEST_F(RecordingWriterTest, FlushedRecordsAreInTheFile) {
  for (const char* const name : {"a.r4log", "a.r4log.zst"}) {
    all.clear();
    RecordingWriter writer(path(name), {});
    writer.declare(RecordedPath{1, "udp://robot", ""});
    for (int i = 0; i < 10; ++i) {
      append(writer);
      writer.flush();
      const Heard heard = heard_in(content(name));
      EXPECT_EQ(heard.records, all) << name;
      EXPECT_EQ(heard.paths.size(), 1);
    }
    writer.close();
    EXPECT_TRUE(heard_in(content(name)).damage.empty());
  }
}

TEST_F(RecordingWriterTest, ContinuesAnExistingRecording) {
  for (const char* const name : {"a.r4log", "a.r4log.zst"}) {
    all.clear();
    for (int run = 0; run < 3; ++run) {
      RecordingWriter writer(path(name), {});
      append(writer);
      writer.close();
    }
    const Heard heard = heard_in(content(name));
    EXPECT_EQ(heard.records, all) << name;
    EXPECT_EQ(heard.headers, 3);
    EXPECT_TRUE(heard.damage.empty());
  }
}

TEST_F(RecordingWriterTest, GoesOnAfterATornLine) {
  {
    RecordingWriter writer(path("a.r4log"), {});
    append(writer);
    writer.close();
  }
  std::ofstream(path("a.r4log"), std::ios::app) << "1795468293.4";
  RecordingWriter writer(path("a.r4log"), {});
  append(writer);
  writer.close();
  const Heard heard = heard_in(content("a.r4log"));
  EXPECT_EQ(heard.records, all);
  ASSERT_EQ(heard.damage.size(), 1);
  EXPECT_EQ(heard.damage[0].kind, RecordingDamage::Kind::line);
}

TEST_F(RecordingWriterTest, DoesNotOverwriteOtherFiles) {
  for (const char* const name : {"notes.txt", "a.r4log.zst"}) {
    std::ofstream(path(name)) << "other data";
    const Problem problem = problem_of([&] { RecordingWriter(path(name), {}); });
    EXPECT_EQ(problem.kind, ErrorKind::data);
    EXPECT_EQ(problem.thing, path(name));
    EXPECT_EQ(content(name), "other data");
  }
  const RecordingWriter first(path("a.r4log"), {});
  EXPECT_TRUE(contains(problem_of([&] { RecordingWriter(path("a.r4log"), {}); }).reason,
                       "another program records into this file"));
  EXPECT_EQ(problem_of([&] { RecordingWriter(folder.string(), {}); }).reason, "is a directory");
  ASSERT_EQ(::mkfifo(path("fifo").c_str(), 0600), 0);
  EXPECT_EQ(problem_of([&] { RecordingWriter(path("fifo"), {}); }).reason, "is not a file");
  EXPECT_EQ(problem_of([&] { RecordingWriter(path("no/where.r4log"), {}); }).kind, ErrorKind::open);
}

TEST_F(RecordingWriterTest, RestartsAMovedRemovedOrTruncatedFileAndReportsALoss) {
  for (const std::string ending : {".r4log", ".r4log.zst"}) {
    for (const std::string what : {"moved", "removed", "truncated"}) {
      const std::string file = path("a" + ending), moved = path("moved" + ending);
      all.clear();
      RecordingWriter writer(file, {});
      writer.declare(RecordedPath{1, "udp://robot", "left"});
      for (int i = 0; i < 10; ++i) append(writer);
      writer.flush();
      fs::copy_file(file, moved);
      if (what == "truncated") {
        fs::resize_file(file, 0);
      } else {
        what == "moved" ? fs::rename(file, moved) : static_cast<void>(fs::remove(file));
      }
      append(writer);
      writer.flush();
      const std::optional<Problem> trouble = writer.take_trouble();
      ASSERT_TRUE(trouble);
      EXPECT_EQ(trouble->kind, what == "moved" ? ErrorKind::open : ErrorKind::data);
      EXPECT_EQ(trouble->thing, file);
      EXPECT_TRUE(contains(trouble->reason, "was " + what));
      EXPECT_FALSE(writer.take_trouble()) << "trouble must be reported once";
      append(writer);
      writer.close();
      const Heard before = heard_in(content("moved" + ending));
      const Heard anew = heard_in(content("a" + ending));
      EXPECT_EQ(before.records + anew.records, all);
      EXPECT_TRUE((what != "moved" || before.damage.empty()) && anew.damage.empty());
      EXPECT_EQ(anew.paths.back().name, "left") << "each file must be complete";
      fs::remove(file);
      fs::remove(moved);
    }
  }
}

TEST_F(RecordingWriterTest, EndsTheRecordingIfTheFileCannotBeRestarted) {
  RecordingWriter writer(path("a.r4log"), {});
  append(writer);
  writer.flush();
  fs::remove_all(folder);
  append(writer);
  const Problem problem = problem_of([&] { writer.flush(); });
  EXPECT_EQ(problem.kind, ErrorKind::open);
  EXPECT_EQ(problem.thing, path("a.r4log"));
}

TEST_F(RecordingWriterTest, StaysInItsFolderWhenTheProgramChangesItsWorkingDirectory) {
  const fs::path before = fs::current_path();
  fs::current_path(folder);
  RecordingOptions options;
  options.rotate_after = 2s;
  {
    RecordingWriter writer("drive.r4log", options);
    fs::current_path(before);
    for (int i = 0; i < 300; ++i) append(writer);
    writer.close();
    EXPECT_FALSE(writer.take_trouble());
  }
  EXPECT_EQ(names(), (std::vector<std::string>{"drive-00001.r4log", "drive-00002.r4log"}));
}

TEST_F(RecordingWriterTest, RecordsOnAFileSystemThatHasNoLocks) {
  for (const int error : {ENOLCK, ENOSYS, EOPNOTSUPP, EINVAL}) {
    in_a_thread_of_its_own([&] {
      refuse({SYS_flock, error, std::nullopt});
      EXPECT_NO_THROW(RecordingWriter(path(std::to_string(error)), {})) << error;
    });
  }
  in_a_thread_of_its_own([&] {
    refuse({SYS_flock, EWOULDBLOCK, std::nullopt});
    EXPECT_EQ(problem_of([&] { RecordingWriter(path("taken"), {}); }).reason,
              "another program records into this file");
  });
}

TEST_F(RecordingWriterTest, BeginsANewFileAtTheSizeLimit) {
  for (const char* const ending : {".r4log", ".r4log.zst"}) {
    RecordingOptions options;
    options.rotate_bytes = 20'000;
    RecordingWriter writer(path("drive") + ending, options);
    writer.declare(RecordedPath{1, "udp://robot", "left"});
    for (int i = 0; i < 3000; ++i) {
      append(writer);
      if (i % 50 == 0) writer.flush();
    }
    writer.close();
  }
  std::string read, read_zst;
  for (const std::string& name : names()) {
    EXPECT_LE(fs::file_size(path(name)), 30'000) << name;
    const Heard heard = heard_in(content(name));
    EXPECT_EQ(heard.headers, 1) << "each file must be complete: " << name;
    EXPECT_EQ(heard.paths.back().name, "left") << name;
    (name.ends_with(".zst") ? read_zst : read) += heard.records;
  }
  EXPECT_EQ(names().front(), "drive-00001.r4log");
  EXPECT_GE(names().size(), 10);
  EXPECT_EQ(read + read_zst, all);
}

TEST_F(RecordingWriterTest, BeginsANewFileAtTheTimeLimitAndDeclaresItsDevicesInEachFile) {
  RecordingOptions options;
  options.rotate_after = 2s;
  RecordingWriter writer(path("drive.r4log"), options);
  writer.declare(RecordedPath{1, "udp://robot", ""});
  writer.declare(RecordedDevice{1, "bno055@0x28:1", "older"});
  for (int i = 0; i < 100; ++i) append(writer);
  writer.declare(RecordedDevice{1, "bno055@0x28:1", "newer"});
  writer.declare(RecordedDevice{1, "as5600@0x36:3", "another"});
  for (int i = 0; i < 400; ++i) append(writer);
  writer.close();
  ASSERT_EQ(names().size(), 3);
  for (const std::string& name : names()) {
    const bool first = name == names().front();
    const Heard heard = heard_in(content(name));
    EXPECT_EQ(heard.count, name == names().back() ? 100 : 200) << name;
    const std::vector<RecordedDevice>& devices = heard.devices;
    ASSERT_EQ(devices.size(), first ? 3 : 2) << name;
    EXPECT_EQ(devices[0].description, first ? "older" : "newer");
    EXPECT_EQ(devices.back().place, "as5600@0x36:3");
  }
}

TEST_F(RecordingWriterTest, DeletesItsOldestFilesAboveTheKeepLimit) {
  std::ofstream(path("drive-notes.r4log")) << "of somebody else";
  RecordingOptions options;
  options.keep_bytes = 1 << 20;
  for (int run = 0; run < 2; ++run) {
    RecordingWriter writer(path("drive.r4log"), options);
    for (int i = 0; i < 20'000; ++i) {
      append(writer);
      if (i % 1000 == 0) {
        writer.flush();
        ASSERT_LE(size_of_all(), options.keep_bytes + 70'000);
      }
    }
    writer.close();
  }
  EXPECT_GE(size_of_all(), options.keep_bytes / 2);
  std::string read;
  for (const std::string& name : names()) {
    if (name != "drive-notes.r4log") read += heard_in(content(name)).records;
  }
  EXPECT_TRUE(all.ends_with(read)) << "the newest records must be kept";
  EXPECT_EQ(content("drive-notes.r4log"), "of somebody else");
}

TEST_F(RecordingWriterTest, RefusesImpossibleLimits) {
  RecordingOptions options;
  options.keep_bytes = 1000;
  EXPECT_EQ(problem_of([&] { RecordingWriter(path("a"), options); }).kind, ErrorKind::usage);
  options.keep_bytes = 2'000'000;
  options.rotate_bytes = 1'000'000;
  EXPECT_EQ(problem_of([&] { RecordingWriter(path("a"), options); }).kind, ErrorKind::usage);
  EXPECT_TRUE(names().empty());
}

TEST_F(RecordingWriterTest, AFullDiskIsAnErrorAndKeepsTheFlushedRecords) {
  RecordingWriter writer(path("a.r4log"), {});
  std::string flushed;
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const Problem problem = problem_of([&] {
    const FileLimit limit(10'000);
    for (int i = 0; i < 1000; ++i) {
      append(writer);
      writer.flush();
      flushed = all;
    }
  });
  std::signal(SIGXFSZ, handler);
  EXPECT_EQ(problem.kind, ErrorKind::open);
  EXPECT_EQ(problem.thing, path("a.r4log"));
  EXPECT_TRUE(contains(problem.reason, "the recording has ended"));
  EXPECT_TRUE(contains(problem.fix, "--keep"));
  const Heard heard = heard_in(content("a.r4log"));
  EXPECT_EQ(heard.records, flushed);
  EXPECT_TRUE(heard.damage.empty());
}

}  // namespace
}  // namespace r4::test
