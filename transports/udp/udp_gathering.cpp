// SPDX-License-Identifier: GPL-3.0-or-later
#include "udp_gathering.hpp"

#include <sys/socket.h>

#include <cerrno>
#include <cstring>
#include <ctime>

namespace r4 {
namespace {

// An error is of a packet that was sent before, and is told once.
constexpr int most_errors = 4;

class QuietLoop final : public asio::execution_context::service {
 public:
  using key_type = QuietLoop;
  static asio::execution_context::id id;
  explicit QuietLoop(asio::execution_context& context) : service(context) {}
  void shutdown() noexcept override {}

  asio::io_context io;
};
asio::execution_context::id QuietLoop::id;

std::chrono::nanoseconds since_epoch(const timespec& time) {
  return std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec);
}

// The kernel notes it by the wall clock, which may have been set meanwhile.
std::optional<UdpGathering::SteadyTime> steady_time_of(const timespec& came) {
  const auto now = std::chrono::steady_clock::now();
  timespec real{};
  ::clock_gettime(CLOCK_REALTIME, &real);
  const std::chrono::nanoseconds age = since_epoch(real) - since_epoch(came);
  if (age.count() < 0 || age > std::chrono::seconds(1)) return std::nullopt;
  return now - age;
}

}  // namespace

UdpSocket UdpGathering::quiet_socket(asio::io_context& io) {
  return UdpSocket(asio::use_service<QuietLoop>(io).io);
}

void UdpGathering::note_times(int socket) {
  if (std::exchange(socket_, socket) == socket) return;
  const int yes = 1;
  ::setsockopt(socket, SOL_SOCKET, SO_TIMESTAMPNS, &yes, sizeof yes);
}

// NOLINTNEXTLINE(readability-non-const-parameter): the kernel writes to it
std::optional<std::size_t> UdpGathering::read(char* out, std::size_t room, Endpoint& from) {
  alignas(cmsghdr) char control[CMSG_SPACE(sizeof(timespec))];
  iovec part{out, room};
  msghdr message{};
  ssize_t size = -1;
  for (int i = 0; size < 0 && i < most_errors; ++i) {
    message = {};
    message.msg_name = from.data();
    message.msg_namelen = static_cast<socklen_t>(from.capacity());
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control;
    message.msg_controllen = sizeof control;
    size = ::recvmsg(socket_, &message, MSG_DONTWAIT | MSG_TRUNC);
    if (size < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) break;
  }
  if (size < 0) return std::nullopt;
  from.resize(message.msg_namelen);
  arrival_.reset();
  const cmsghdr* const item = CMSG_FIRSTHDR(&message);
  if (item != nullptr && item->cmsg_level == SOL_SOCKET && item->cmsg_type == SO_TIMESTAMPNS) {
    timespec came{};
    std::memcpy(&came, CMSG_DATA(item), sizeof came);
    arrival_ = steady_time_of(came);
  }
  return static_cast<std::size_t>(size);
}

}  // namespace r4
