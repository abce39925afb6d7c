// SPDX-License-Identifier: GPL-3.0-or-later
#include "output_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <utility>

#include "r4link/error.hpp"

namespace r4::tool {
OutputFile::OutputFile(std::string path, bool replace)
    : path_(std::move(path)), part_(path_ + ".part"), replace_(replace) {
  struct stat status {};
  if (::lstat(path_.c_str(), &status) == 0) {
    if (!S_ISREG(status.st_mode)) {
      throw Error(ErrorKind::open, path_,
                  S_ISDIR(status.st_mode) ? "is a directory" : "is not a file", "name a new file");
    }
    if (!replace_) {
      throw Error(ErrorKind::open, path_, "already exists",
                  "name another file, or add --force to replace this file");
    }
  }
  // An unnamed file disappears if the program ends early. Not every file system supports O_TMPFILE.
  const std::size_t slash = path_.rfind('/');
  const std::string folder = slash == std::string::npos ? "." : path_.substr(0, slash + 1);
  int file = ::open(folder.c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, 0666);
  named_ = file < 0;
  if (named_) {
    file = ::open(part_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0666);
  }
  file_.reset(file < 0 ? nullptr : ::fdopen(file, "wb"));
  if (!file_) fail(errno);
}

OutputFile::~OutputFile() {
  if (file_ && named_) ::unlink(part_.c_str());
}

void OutputFile::write(std::string_view bytes) {
  if (std::fwrite(bytes.data(), 1, bytes.size(), file_.get()) != bytes.size()) fail(errno);
}

void OutputFile::finish() {
  if (std::fflush(file_.get()) != 0) fail(errno);
  if (!named_) {
    const std::string here = "/proc/self/fd/" + std::to_string(::fileno(file_.get()));
    ::unlink(part_.c_str());
    if (::linkat(AT_FDCWD, here.c_str(), AT_FDCWD, part_.c_str(), AT_SYMLINK_FOLLOW) != 0) {
      fail(errno);
    }
    named_ = true;
  }
  const unsigned flags = replace_ ? 0 : RENAME_NOREPLACE;
  if (::renameat2(AT_FDCWD, part_.c_str(), AT_FDCWD, path_.c_str(), flags) != 0) {
    // Not every file system supports RENAME_NOREPLACE.
    if (errno != EINVAL || ::rename(part_.c_str(), path_.c_str()) != 0) fail(errno);
  }
  file_.reset();
}

void OutputFile::fail(int error) const {
  const bool denied = error == EACCES || error == EPERM || error == EROFS;
  const bool full = error == ENOSPC || error == EDQUOT || error == EFBIG;
  throw Error(denied ? ErrorKind::permission : ErrorKind::open, path_, std::strerror(error),
              denied ? "name a directory that you may write to"
              : full ? "free some space on this disk, or name a file on another disk"
                     : "name a file that can be written");
}

}  // namespace r4::tool
