// SPDX-License-Identifier: GPL-3.0-or-later
#include "share_socket.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/uio.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

namespace r4 {
namespace {

// A program that comes while the holder hangs waits, too, until that program has gone again.
constexpr int most_waiting = 128;
// About eighty states: who sleeps and wakes up hears nothing much older than a second.
constexpr int buffer_bytes = 32 * 1024;

struct Address {
  sockaddr_un bytes{};
  socklen_t size = 0;
};

// A name that is too long for the kernel ends in a number made of the whole.
Address address_of(const SharedWire& wire) {
  Address address;
  address.bytes.sun_family = AF_UNIX;
  const std::string whose =
      wire.group.name.empty() ? std::to_string(::geteuid()) : "@" + wire.group.name;
  std::string name = fmt::format("r4link/{}/{}", whose, wire.name);
  constexpr std::size_t most = sizeof(address.bytes.sun_path) - 1;
  if (name.size() > most) {
    std::uint64_t hash = 14695981039346656037U;  // FNV-1a
    for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211U;
    name = fmt::format("{}{:016x}", name.substr(0, most - 16), hash);
  }
  std::memcpy(address.bytes.sun_path + 1, name.data(), name.size());
  address.size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
  return address;
}

FileDescriptor local_socket() {
  FileDescriptor descriptor(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (descriptor) {
    ::setsockopt(descriptor.get(), SOL_SOCKET, SO_SNDBUF, &buffer_bytes, sizeof buffer_bytes);
  }
  return descriptor;
}

}  // namespace

SharedWire at_place(const SharedWire& wire, int place) {
  SharedWire there = wire;
  if (place != 0) there.name += fmt::format("+{}", place);
  return there;
}

FileDescriptor hold_wire(const SharedWire& wire) {
  FileDescriptor descriptor = local_socket();
  const Address address = address_of(wire);
  if (!descriptor ||
      ::bind(descriptor.get(), reinterpret_cast<const sockaddr*>(&address.bytes), address.size) !=
          0 ||
      ::listen(descriptor.get(), most_waiting) != 0) {
    return {};
  }
  return descriptor;
}

ReachedHolder reach_holder(const SharedWire& wire, std::chrono::milliseconds within) {
  FileDescriptor descriptor = local_socket();
  const Address address = address_of(wire);
  if (!descriptor) return {};
  const auto connect = [&] {
    return ::connect(descriptor.get(), reinterpret_cast<const sockaddr*>(&address.bytes),
                     address.size) == 0;
  };
  bool connected = connect();
  if (!connected && would_block(errno) && within.count() > 0) {
    // The kernel queues those that wait for a place. One that tried again and again would be overtaken.
    const int flags = ::fcntl(descriptor.get(), F_GETFL);
    const timeval most{0, static_cast<suseconds_t>(std::chrono::microseconds(within).count())};
    ::setsockopt(descriptor.get(), SOL_SOCKET, SO_SNDTIMEO, &most, sizeof most);
    ::fcntl(descriptor.get(), F_SETFL, flags & ~O_NONBLOCK);
    connected = connect();
    const int error = errno;
    ::fcntl(descriptor.get(), F_SETFL, flags);
    errno = error;
  }
  if (connected) return {std::move(descriptor), false};
  return {FileDescriptor(), would_block(errno)};
}

FileDescriptor accept_sharer(int holder) {
  FileDescriptor descriptor(::accept4(holder, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
  if (descriptor) {
    ::setsockopt(descriptor.get(), SOL_SOCKET, SO_SNDBUF, &buffer_bytes, sizeof buffer_bytes);
  }
  return descriptor;
}

ShareCredentials credentials_of(int connection) {
  ucred peer{};
  socklen_t size = sizeof peer;
  if (::getsockopt(connection, SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0) {
    return {0, static_cast<uid_t>(-1), static_cast<gid_t>(-1)};
  }
  return {peer.pid, peer.uid, peer.gid};
}

bool is_one_of_us(int connection, const SharedWire& wire) {
  const ShareCredentials peer = credentials_of(connection);
  if (peer.uid == ::geteuid()) return true;
  if (wire.group.name.empty()) return false;
  if (peer.uid == 0 || peer.gid == wire.group.id) return true;
  // Asked for nothing, the kernel says how much there is.
  socklen_t size = 0;
  if (::getsockopt(connection, SOL_SOCKET, SO_PEERGROUPS, nullptr, &size) == 0) return false;
  std::vector<gid_t> groups(size / sizeof(gid_t));
  if (::getsockopt(connection, SOL_SOCKET, SO_PEERGROUPS, groups.data(), &size) != 0) return false;
  groups.resize(size / sizeof(gid_t));
  return std::find(groups.begin(), groups.end(), wire.group.id) != groups.end();
}

bool may_come(int connection, const SharedWire& wire) {
  return is_one_of_us(connection, wire) || credentials_of(connection).uid == 0;
}

int send_message(int connection, ShareMessage::Kind kind, std::string_view text) {
  char letter = static_cast<char>(kind);
  iovec parts[2] = {{&letter, 1}, {const_cast<char*>(text.data()), text.size()}};
  msghdr message{};
  message.msg_iov = parts;
  message.msg_iovlen = 2;
  ssize_t sent = 0;
  do {
    sent = ::sendmsg(connection, &message, MSG_DONTWAIT | MSG_NOSIGNAL);
  } while (sent < 0 && errno == EINTR);
  return sent < 0 ? errno : 0;
}

ssize_t receive_packet(int connection, char* out, std::size_t size) {
  ssize_t received = 0;
  do {
    received = ::recv(connection, out, size, MSG_DONTWAIT | MSG_TRUNC);
  } while (received < 0 && errno == EINTR);
  return received;
}

}  // namespace r4
