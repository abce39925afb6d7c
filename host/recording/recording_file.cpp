// SPDX-License-Identifier: GPL-3.0-or-later
#include "recording_file.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "r4link/error.hpp"
#include "r4link/recording.hpp"
#include "r4link/recordings/recording_reader.hpp"
#include "r4link/recordings/zstd_stream.hpp"

namespace r4 {
namespace {

Error cannot_be_written(const std::string& path, int error) {
  if (error == EACCES || error == EPERM || error == EROFS) {
    return {ErrorKind::permission, path, std::strerror(error),
            "record into a directory that you may write to"};
  }
  if (error == ENOSPC || error == EDQUOT || error == EFBIG) {
    return {ErrorKind::open, path, std::string("the recording has ended: ") + std::strerror(error),
            "free some disk space, and limit the size: r4 record --keep 10G"};
  }
  return {ErrorKind::open, path, std::strerror(error), "give a file that can be written"};
}

Error cannot_be_read(const std::string& path, int error) {
  const bool denied = error == EACCES || error == EPERM;
  return {
      denied ? ErrorKind::permission : ErrorKind::open, path, std::strerror(error),
      denied ? "allow reading of the file: chmod +r" : "give a recording, or - for standard input"};
}

// False if another program has locked the file. True on a file system without locks.
bool lock_alone(int file) {
  while (::flock(file, LOCK_EX | LOCK_NB) != 0) {
    if (errno != EINTR) return errno != EWOULDBLOCK;
  }
  return true;
}

}  // namespace

RecordingFile::RecordingFile(std::string path) : path_(std::move(path)) {
  struct stat status {};
  // Do not open a device, because a terminal may lead to a board.
  if (::stat(path_.c_str(), &status) == 0 && !S_ISREG(status.st_mode)) {
    throw Error(ErrorKind::open, path_,
                S_ISDIR(status.st_mode) ? "is a directory" : "is not a file",
                "give a file that can be written");
  }
  file_.reset(::open(path_.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC | O_NOCTTY, 0666));
  if (!file_ || ::fstat(file_.get(), &status) != 0) throw cannot_be_written(path_, errno);
  if (!lock_alone(file_.get())) {
    throw Error(ErrorKind::open, path_, "another program records into this file",
                "give another file");
  }
  size_ = static_cast<std::uint64_t>(status.st_size);
  if (size_ != 0) look_at_what_is_there();
}

void RecordingFile::look_at_what_is_there() {
  std::array<char, 16> first{};
  const ssize_t n = ::pread(file_.get(), first.data(), first.size(), 0);
  if (n < 0) throw cannot_be_read(path_, errno);
  const std::string_view beginning(first.data(), static_cast<std::size_t>(n));
  const bool compressed = is_zstd(beginning);
  const bool wanted = path_.ends_with(".zst");
  if (compressed != wanted || (!compressed && !beginning.starts_with("# r4log "))) {
    throw Error(ErrorKind::data, path_, "already holds other data", "give another file");
  }
  char last = 0;
  if (::pread(file_.get(), &last, 1, static_cast<off_t>(size_ - 1)) < 0) {
    throw cannot_be_read(path_, errno);
  }
  torn_ = !compressed && last != '\n';
}

void RecordingFile::append(std::string_view bytes) {
  const std::size_t all = bytes.size();
  while (!bytes.empty()) {
    const ssize_t n = ::write(file_.get(), bytes.data(), bytes.size());
    if (n >= 0) {
      bytes.remove_prefix(static_cast<std::size_t>(n));
    } else if (errno != EINTR) {
      const int error = errno;
      // Removes the incomplete line. If this fails, a reader skips the line.
      [[maybe_unused]] const int removed = ::ftruncate(file_.get(), static_cast<off_t>(size_));
      throw cannot_be_written(path_, error);
    }
  }
  if (::fdatasync(file_.get()) != 0) throw cannot_be_written(path_, errno);
  size_ += all;
}

RecordingFile::Fate RecordingFile::fate() const {
  struct stat mine {};
  struct stat there {};
  if (::fstat(file_.get(), &mine) != 0) return Fate::here;  // append() reports the error
  if (mine.st_nlink == 0) return Fate::removed;
  if (static_cast<std::uint64_t>(mine.st_size) < size_) return Fate::truncated;
  const bool same = ::stat(path_.c_str(), &there) == 0 && there.st_dev == mine.st_dev &&
                    there.st_ino == mine.st_ino;
  return same ? Fate::here : Fate::moved;
}

RecordingInput::RecordingInput(const std::string& path)
    : name_(path == "-" ? "standard input" : path),
      file_(path == "-" ? ::fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 3)
                        : ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOCTTY)) {
  if (!file_) throw cannot_be_read(name_, errno);
}

std::string_view RecordingInput::read() {
  for (;;) {
    const ssize_t n = ::read(file_.get(), piece_.data(), piece_.size());
    if (n >= 0) return {piece_.data(), static_cast<std::size_t>(n)};
    if (errno != EINTR) throw cannot_be_read(name_, errno);
  }
}

void read_in_pieces(const std::string& path, const std::function<void(std::string_view)>& take) {
  RecordingInput input(path);
  for (std::string_view piece = input.read(); !piece.empty(); piece = input.read()) take(piece);
}

void read_recording(const std::string& path, RecordingVisitor& visitor) {
  RecordingReader reader(visitor, path == "-" ? "standard input" : path);
  read_in_pieces(path, [&reader](std::string_view piece) { reader.feed(piece); });
  reader.finish();
}

}  // namespace r4
