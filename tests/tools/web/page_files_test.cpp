// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/r4/web/server/page_files.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace r4::tool::web {
namespace {

namespace fs = std::filesystem;

TEST(WebPageFiles, AFolderServesItsOwnRegularFilesAndNothingElse) {
  const fs::path place = fs::path(testing::TempDir()) / ("r4-page-" + std::to_string(::getpid()));
  const std::string folder = place / "page";
  fs::create_directories(place / "page" / "sub.js");
  std::ofstream(place / "page" / "main.js") << "ours";
  std::ofstream(place / "page" / ".hidden") << "secret";
  std::ofstream(place / "page" / "sub.js" / "below.js") << "secret";
  std::ofstream(place / "page.key") << "secret";
  std::ofstream(place / "page" / "large.js").close();
  fs::resize_file(place / "page" / "large.js", 5 << 20);
  ASSERT_EQ(::mkfifo((place / "page" / "pipe.js").c_str(), 0600), 0);
  const std::optional<PageFile> file = page_file_in(folder, "/main.js");
  ASSERT_TRUE(file);
  EXPECT_EQ(file->content, "ours");
  EXPECT_EQ(file->type, "text/javascript; charset=utf-8");
  for (const char* path :
       {"", "/", ".key", "-", "?x", "/.", "/..", "/.hidden", "/../page.key", "//etc/passwd",
        "/sub.js", "/sub.js/below.js", "/nothing.js", "/pipe.js", "/large.js"}) {
    EXPECT_FALSE(page_file_in(folder, path)) << path;
  }
  fs::remove_all(place);
}

}  // namespace
}  // namespace r4::tool::web
