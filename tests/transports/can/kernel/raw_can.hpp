// SPDX-License-Identifier: GPL-3.0-or-later
// A CAN_RAW socket for tests. The socket receives one id, and every wait has a limit. If the kernel
// refuses a call, the class throws the reason, so the test fails with the reason.
#pragma once

#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <ctime>
#include <string>
#include <system_error>

#include "r4link/can/can_frame.hpp"
#include "transports/framing/can/isotp.hpp"

namespace r4::test {

constexpr char can_interface[] = "vcan0";

// Microseconds of a monotonic clock. The value wraps.
inline std::uint32_t clock_us() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<std::uint32_t>(static_cast<std::uint64_t>(now.tv_sec) * 1000000 +
                                    static_cast<std::uint64_t>(now.tv_nsec) / 1000);
}

// Waits for `events` of `fd` until `until_us`. An error of the socket also ends the wait.
inline bool await(int fd, short events, std::uint32_t until_us) {
  const std::uint32_t now_us = clock_us();
  const std::uint32_t left_us = reached(now_us, until_us) ? 0 : until_us - now_us;
  const timespec limit{left_us / 1000000, static_cast<long>(left_us % 1000000) * 1000};
  pollfd wait{fd, events, 0};
  return ppoll(&wait, 1, &limit, nullptr) == 1;
}

// A socket of PF_CAN. The derived class binds it to the interface.
class CanSocket {
 public:
  CanSocket(const CanSocket&) = delete;
  CanSocket& operator=(const CanSocket&) = delete;

 protected:
  CanSocket(int type, int protocol) : fd_(socket(PF_CAN, type | SOCK_CLOEXEC, protocol)) {
    if (fd_ < 0) fail("no CAN sockets here, tools/with-can has them");
  }
  ~CanSocket() { close(fd_); }

  [[noreturn]] static void fail(const char* what) {
    throw std::system_error(errno, std::generic_category(), what);
  }
  template <typename Value>
  void set(int level, int option, const Value& value, const char* name) {
    if (setsockopt(fd_, level, option, &value, sizeof value) != 0) fail(name);
  }
  void bind_to_interface(sockaddr_can address, const char* interface = can_interface) {
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(if_nametoindex(interface));
    if (address.can_ifindex == 0) fail(interface);
    if (bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) fail("bind");
  }
  int fd() const { return fd_; }

 private:
  int fd_;
};

class RawCan : CanSocket {
 public:
  // Receives classic and FD frames with the given 11-bit id, but not the frames that it sends.
  explicit RawCan(std::uint32_t heard_id, const char* interface = can_interface)
      : CanSocket(SOCK_RAW, CAN_RAW) {
    set(SOL_CAN_RAW, CAN_RAW_FILTER, can_filter{heard_id, CAN_SFF_MASK | CAN_EFF_FLAG},
        "CAN_RAW_FILTER");
    set(SOL_CAN_RAW, CAN_RAW_FD_FRAMES, 1, "CAN_RAW_FD_FRAMES");
    set(SOL_SOCKET, SO_RCVBUF, 1 << 20, "SO_RCVBUF");  // the system may grant less
    bind_to_interface({}, interface);
  }

  // If the queue is full (ENOBUFS), the frame is offered until the kernel accepts it.
  void send(const CanFrame& frame, std::uint32_t limit_us = 1000000) {
    canfd_frame raw{};
    raw.can_id = frame.id;
    raw.len = frame.size;
    std::memcpy(raw.data, frame.data, frame.size);
    const std::size_t size = frame.fd ? CANFD_MTU : CAN_MTU;
    const std::uint32_t until_us = clock_us() + limit_us;
    while (write(fd(), &raw, size) != static_cast<ssize_t>(size)) {
      if ((errno != ENOBUFS && errno != EINTR) || reached(clock_us(), until_us)) fail("send");
      poll(nullptr, 0, 1);
    }
  }

  // Receives the next frame. False if no frame arrives before the given time.
  bool receive(CanFrame& frame, std::uint32_t until_us) {
    canfd_frame raw;
    ssize_t size;
    while ((size = recv(fd(), &raw, sizeof raw, MSG_DONTWAIT)) < 0) {
      if (errno != EAGAIN && errno != EINTR) fail("receive");
      if (!await(fd(), POLLIN, until_us) && reached(clock_us(), until_us)) return false;
    }
    frame.id = raw.can_id & CAN_EFF_MASK;
    frame.size = raw.len;
    frame.fd = size == static_cast<ssize_t>(CANFD_MTU);
    frame.extended = (raw.can_id & CAN_EFF_FLAG) != 0;
    frame.remote = (raw.can_id & CAN_RTR_FLAG) != 0;
    std::memcpy(frame.data, raw.data, raw.len);
    return true;
  }
};

}  // namespace r4::test
