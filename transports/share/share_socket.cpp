// SPDX-License-Identifier: GPL-3.0-or-later
#include "share_socket.hpp"

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <asio/local/datagram_protocol.hpp>
#include <cstddef>
#include <fstream>
#include <vector>

namespace r4 {
namespace {

// At 0.4 ms each (ShareHolder::between_arrivals), the last program is accepted before it gives up.
constexpr int most_waiting = 24;
// About 80 states, so a program that wakes up reads nothing much older than a second.
constexpr int buffer_bytes = 32 * 1024;

using Address = asio::local::datagram_protocol::endpoint;

// A name that is too long for the kernel ends in a hash of the whole name.
Address address_of(const ShareName& share, BoardRole role) {
  const std::string whose =
      share.group.name.empty() ? std::to_string(::geteuid()) : "@" + share.group.name;
  std::string name = fmt::format("r4link/{}/{}{}", whose,
                                 role == BoardRole::control ? "control/" : "", share.text);
  constexpr std::size_t most = sizeof(sockaddr_un::sun_path) - 2;
  if (name.size() > most) {
    std::uint64_t hash = 14695981039346656037U;  // FNV-1a
    for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211U;
    name = fmt::format("{}{:016x}", name.substr(0, most - 16), hash);
  }
  return Address('\0' + name);
}

// A socket for which `use(socket, address, size)` has returned 0. If a call failed: an empty
// descriptor, and errno is set.
template <class Use>
FileDescriptor local_socket(const ShareName& name, BoardRole role, Use use) {
  FileDescriptor local(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const Address address = address_of(name, role);
  const auto size = static_cast<socklen_t>(address.size());
  if (local && use(local.get(), address.data(), size) == 0) return local;
  return FileDescriptor();
}

ucred credentials_of(int connection) {
  ucred peer{0, static_cast<uid_t>(-1), static_cast<gid_t>(-1)};
  socklen_t size = sizeof peer;
  ::getsockopt(connection, SOL_SOCKET, SO_PEERCRED, &peer, &size);
  return peer;
}

}  // namespace

FileDescriptor take_share_name(const ShareName& name, BoardRole role) {
  return local_socket(name, role, [](int local, const sockaddr* address, socklen_t size) {
    return ::bind(local, address, size) == 0 ? ::listen(local, most_waiting) : -1;
  });
}

// Tries for about the time between two accept() calls, because other users may keep the queue full.
FileDescriptor connect_to_holder(const ShareName& name, BoardRole role) {
  return local_socket(name, role, [](int local, const sockaddr* address, socklen_t size) {
    constexpr int most_tries = 300;
    int result = -1;
    for (int i = 0; i < most_tries && result != 0; ++i) {
      result = ::connect(local, address, size);
      if (result != 0 && !would_block(errno)) break;
    }
    return result;
  });
}

FileDescriptor accept_sharer(int holder) {
  FileDescriptor sharer(::accept4(holder, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
  if (sharer) ::setsockopt(sharer.get(), SOL_SOCKET, SO_SNDBUF, &buffer_bytes, sizeof buffer_bytes);
  return sharer;
}

bool is_one_of_us(int connection, const ShareName& name) {
  const ucred peer = credentials_of(connection);
  if (peer.uid == ::geteuid()) return true;
  if (name.group.name.empty()) return false;
  if (peer.uid == 0 || peer.gid == name.group.id) return true;
  // With size 0 the kernel reports the size that it needs.
  socklen_t size = 0;
  if (::getsockopt(connection, SOL_SOCKET, SO_PEERGROUPS, nullptr, &size) == 0) return false;
  std::vector<gid_t> groups(size / sizeof(gid_t));
  if (::getsockopt(connection, SOL_SOCKET, SO_PEERGROUPS, groups.data(), &size) != 0) return false;
  groups.resize(size / sizeof(gid_t));
  return std::find(groups.begin(), groups.end(), name.group.id) != groups.end();
}

pid_t process_of(int connection) { return credentials_of(connection).pid; }

std::string program_of(pid_t process) {
  std::ifstream file(fmt::format("/proc/{}/comm", process));
  std::string name;
  return std::getline(file, name) ? printable(name) : "another program";
}

bool is_stopped(pid_t process) {
  std::ifstream file(fmt::format("/proc/{}/status", process));
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("State:")) return line.find("\tT") != std::string::npos;
  }
  return false;
}

int send_message(int connection, ShareMessage::Kind kind, std::string_view text) {
  char letter = static_cast<char>(kind);
  iovec parts[2] = {{&letter, 1}, {const_cast<char*>(text.data()), text.size()}};
  msghdr message{};
  message.msg_iov = parts;
  message.msg_iovlen = 2;
  return ::sendmsg(connection, &message, MSG_NOSIGNAL) < 0 ? errno : 0;
}

}  // namespace r4
