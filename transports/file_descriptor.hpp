// SPDX-License-Identifier: GPL-3.0-or-later
// A file descriptor with an owner; what to do where there is none left; and sockets of Asio's that
// a program which this one starts does not inherit: it would keep the port for as long as it runs.
#pragma once

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <optional>
#include <string>
#include <utility>

#include "r4link/error.hpp"

namespace r4 {

class FileDescriptor {
 public:
  FileDescriptor() = default;
  explicit FileDescriptor(int number) : number_(number) {}  // -1: none
  FileDescriptor(FileDescriptor&& other) noexcept : number_(other.release()) {}
  FileDescriptor& operator=(FileDescriptor&& other) noexcept {
    reset(other.release());
    return *this;
  }
  ~FileDescriptor() { reset(); }

  int get() const { return number_; }
  explicit operator bool() const { return number_ >= 0; }
  int release() { return std::exchange(number_, -1); }
  void reset(int number = -1) {
    if (number_ >= 0) ::close(number_);
    number_ = number;
  }

 private:
  int number_ = -1;
};

// Why `thing` cannot be opened, if that `error` (errno) is that the program, or the system, has no file left for it.
inline std::optional<Problem> out_of_files(const std::string& thing, int error) {
  if (error == ENFILE) {
    return Problem{ErrorKind::open, thing, "this computer has no file left", "end some programs"};
  }
  if (error != EMFILE) return std::nullopt;
  rlimit limit{};
  ::getrlimit(RLIMIT_NOFILE, &limit);
  return Problem{
      ErrorKind::open, thing,
      "this program may have " + std::to_string(limit.rlim_cur) + " files open, and has them",
      "open fewer boards, or allow it more before it begins: ulimit -n " +
          std::to_string(4 * limit.rlim_cur)};
}

// As socket.open(protocol, error), also of an acceptor.
template <class Socket, class ErrorCode>
void open_close_on_exec(Socket& socket, const typename Socket::protocol_type& protocol,
                        ErrorCode& error) {
  const int descriptor =
      ::socket(protocol.family(), protocol.type() | SOCK_CLOEXEC, protocol.protocol());
  if (descriptor < 0) {
    error.assign(errno, error.category());
    return;
  }
  socket.assign(protocol, descriptor, error);
  if (error) ::close(descriptor);
}

// For one that Asio has opened itself.
inline void close_on_exec(int descriptor) { ::fcntl(descriptor, F_SETFD, FD_CLOEXEC); }

}  // namespace r4
