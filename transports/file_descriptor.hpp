// SPDX-License-Identifier: GPL-3.0-or-later
// File descriptors, and sockets of Asio that no child inherits: a child would keep the port open.
#pragma once

#include <fcntl.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <optional>
#include <string>
#include <system_error>
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

// The problem if `error` (errno) means that files, memory or epoll watches are used up.
inline std::optional<Problem> out_of_resources(const std::string& thing, int error) {
  if (error == ENFILE) {
    return Problem{ErrorKind::open, thing, "this computer has reached its limit of open files",
                   "end some programs"};
  }
  if (error == ENOMEM || error == ENOBUFS) {
    return Problem{ErrorKind::open, thing, "this computer does not have enough free memory",
                   "end some programs"};
  }
  if (error == ENOSPC) {  // from epoll_ctl(2)
    return Problem{
        ErrorKind::open, thing, "this user has reached the limit of epoll watches",
        "end some programs, or raise the limit, which sysctl fs.epoll.max_user_watches shows"};
  }
  if (error != EMFILE) return std::nullopt;
  rlimit limit{};
  ::getrlimit(RLIMIT_NOFILE, &limit);
  return Problem{
      ErrorKind::open, thing,
      "this program has reached its limit of " + std::to_string(limit.rlim_cur) + " open files",
      "open fewer boards, or raise the limit before you start the program: ulimit -n " +
          std::to_string(4 * limit.rlim_cur)};
}

// Throws std::system_error if a new loop would sleep for ever: Asio does not check its watches.
inline void require_watches() {
  const FileDescriptor epoll(::epoll_create1(EPOLL_CLOEXEC));
  const FileDescriptor events[] = {FileDescriptor(::eventfd(0, EFD_CLOEXEC)),
                                   FileDescriptor(::eventfd(0, EFD_CLOEXEC))};
  for (const FileDescriptor& each : events) {
    epoll_event wanted{};
    wanted.events = EPOLLIN;
    if (!epoll || !each || ::epoll_ctl(epoll.get(), EPOLL_CTL_ADD, each.get(), &wanted) != 0) {
      throw std::system_error(errno, std::generic_category());
    }
  }
}

// Returns the result of `action`. A std::system_error becomes an Error about `thing`.
template <class Action>
auto with_system_errors(const std::string& thing, Action action) {
  try {
    return action();
  } catch (const std::system_error& error) {
    throw Error(problem_of(thing, error));
  }
}

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

// Lets the object of Asio own `descriptor` and wait for it. False, with errno, if `descriptor` is
// none, or if the loop cannot wait for it.
template <class Descriptor>
bool give_to_loop(Descriptor& owner, FileDescriptor descriptor) {
  if (!descriptor) return false;
  std::error_code error;
  owner.assign(descriptor.get(), error);
  if (!error) return descriptor.release() >= 0;
  errno = error.value();
  return false;
}

inline void close_on_exec(int descriptor) { ::fcntl(descriptor, F_SETFD, FD_CLOEXEC); }

}  // namespace r4
