// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "r4link/options.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

struct KeyFile : testing::Test {
  ~KeyFile() override { std::filesystem::remove(path); }
  void write(const std::string& content, mode_t mode) const {
    std::ofstream(path) << content;
    ASSERT_EQ(::chmod(path.c_str(), mode), 0);
  }
  const std::string path = "/tmp/r4-key-" + std::to_string(::getpid());
  const std::string text = "3:" + std::string(2 * key_size, 'e') + "\n";
};

TEST_F(KeyFile, IsLoadedIfOnlyItsOwnerMayReadIt) {
  write(text, 0600);
  const Key key = load_key(path);
  EXPECT_EQ(key.id, 3);
  EXPECT_EQ(key.bytes[0], 0xee);
}

TEST_F(KeyFile, IsRefusedIfOtherUsersMayReadOrWriteIt) {
  for (const mode_t mode : {0644, 0604, 0620, 0602}) {
    write(text, mode);
    const Problem problem = problem_of([&] { load_key(path); });
    EXPECT_EQ(problem.kind, ErrorKind::permission) << mode;
    EXPECT_EQ(problem.thing, path);
    EXPECT_TRUE(contains(problem.fix, "chmod 600"));
  }
}

TEST_F(KeyFile, MayBeReadableByItsGroupIfRootOwnsIt) {
  write(text, 0640);
  if (::geteuid() == 0) {
    EXPECT_EQ(load_key(path).id, 3);
    ASSERT_EQ(::chown(path.c_str(), 1, 1), 0);
  }
  EXPECT_EQ(problem_of([&] { load_key(path); }).kind, ErrorKind::permission);
}

TEST_F(KeyFile, IsNamedInTheErrorIfItHoldsNoValidKey) {
  for (const std::string& wrong : {std::string(), std::string("3:ee\n"), text + text}) {
    write(wrong, 0600);
    const Problem problem = problem_of([&] { load_key(path); });
    EXPECT_EQ(problem.kind, ErrorKind::data) << wrong;
    EXPECT_EQ(problem.thing, path);
    EXPECT_TRUE(contains(problem.fix, "r4 key new"));
  }
}

TEST_F(KeyFile, ReportsAMissingFileAndADirectory) {
  EXPECT_EQ(problem_of([&] { load_key(path); }).kind, ErrorKind::open);
  EXPECT_TRUE(contains(problem_of([] { load_key("/tmp"); }).reason, "directory"));
  EXPECT_TRUE(contains(problem_of([] { load_key("~/no"); }).fix, "$HOME/no"));
}

}  // namespace
}  // namespace r4::test
