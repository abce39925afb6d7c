// SPDX-License-Identifier: GPL-3.0-or-later
#include "can_socket.hpp"

#include <fmt/format.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/uio.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <utility>

#include "r4link/can/can_ids.hpp"
#include "r4link/can/can_interface.hpp"
#include "r4link/error.hpp"

namespace r4 {
namespace {

// Frames in the kernel's queue cannot be withdrawn, so the smallest buffer keeps about six there.
constexpr int least_send_buffer = 1;
constexpr int receive_buffer = 1 << 20;
// The highest priority without a privilege: the first band of pfifo_fast.
constexpr int highest_priority = 6;

template <class Value>
bool set_option(int socket, int level, int name, const Value& value) {
  return ::setsockopt(socket, level, name, &value, sizeof value) == 0;
}

[[noreturn]] void fail(const std::string& interface, int error) {
  throw Error(can_problem(interface, error));
}

FileDescriptor open_socket(const std::string& interface, int index) {
  FileDescriptor socket(::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW));
  if (!socket) fail(interface, errno);
  if (::setsockopt(socket.get(), SOL_CAN_RAW, CAN_RAW_FILTER, nullptr, 0) != 0) {
    fail(interface, errno);
  }
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = index;
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): required by bind(2)
  if (::bind(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    fail(interface, errno);
  }
  return socket;
}

canfd_frame to_kernel(const CanFrame& frame) {
  canfd_frame raw{};
  raw.can_id = frame.id | (frame.extended ? CAN_EFF_FLAG : 0U) | (frame.remote ? CAN_RTR_FLAG : 0U);
  raw.len = frame.size;
  raw.flags = frame.fd ? CANFD_BRS : 0;
  std::memcpy(raw.data, frame.data, frame.size);
  return raw;
}

CanFrame from_kernel(const canfd_frame& raw, bool fd) {
  CanFrame frame;
  frame.extended = (raw.can_id & CAN_EFF_FLAG) != 0;
  frame.remote = (raw.can_id & CAN_RTR_FLAG) != 0;
  frame.id = raw.can_id & (frame.extended ? CAN_EFF_MASK : CAN_SFF_MASK);
  frame.fd = fd;
  frame.size = std::min<std::uint8_t>(raw.len, fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN);
  std::memcpy(frame.data, raw.data, frame.size);
  return frame;
}

CanSocket::Outcome outcome_of(int error) {
  if (error == EAGAIN || error == EWOULDBLOCK) return CanSocket::Outcome::busy;
  if (error == ENOBUFS) return CanSocket::Outcome::full;
  return CanSocket::Outcome::failed;
}

constexpr std::size_t control_size =
    CMSG_SPACE(sizeof(timespec)) + CMSG_SPACE(sizeof(std::uint32_t));

}  // namespace

// The buffers of recvmmsg(). The headers are made once, because most calls take few frames.
struct CanSocket::Inbox {
  struct Control {
    alignas(cmsghdr) char bytes[control_size];
  };
  Inbox() {
    for (std::size_t i = 0; i < batch; ++i) {
      parts[i] = {&raw[i], sizeof(canfd_frame)};
      messages[i].msg_hdr.msg_iov = &parts[i];
      messages[i].msg_hdr.msg_iovlen = 1;
      messages[i].msg_hdr.msg_control = controls[i].bytes;
      messages[i].msg_hdr.msg_controllen = control_size;
    }
  }
  std::array<canfd_frame, batch> raw{};
  std::array<iovec, batch> parts{};
  std::array<mmsghdr, batch> messages{};
  std::array<Control, batch> controls{};
};

CanSocket::CanSocket(std::string interface, bool fd)
    : interface_(std::move(interface)),
      name_("can://" + interface_),
      fd_(fd),
      inbox_(std::make_unique<Inbox>()) {}
CanSocket::~CanSocket() = default;

std::string CanSocket::state() const { return can_interface(interface_).state; }
Problem CanSocket::problem(int error) const { return can_problem(interface_, error); }

void CanSocket::open() {
  close();
  // Distinguishes a kernel without CAN from a missing interface.
  FileDescriptor probe(::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW));
  if (!probe) fail(interface_, errno);
  const CanInterface state = can_interface(interface_);
  if (!state.unknown.empty()) {
    throw Error(ErrorKind::open, name_,
                "the state of the interface is unknown: netlink: " + state.unknown,
                "allow netlink sockets for this program (in a service: RestrictAddressFamilies= "
                "with AF_NETLINK) and enough open files (ulimit -n)");
  }
  if (!state.exists) fail(interface_, ENODEV);
  if (!state.is_can) {
    throw Error(ErrorKind::usage, name_, interface_ + " is not a CAN interface",
                "choose a CAN interface; r4 list shows them");
  }
  if (!state.up) fail(interface_, ENETDOWN);
  if (fd_ && !state.fd) {
    throw Error(ErrorKind::open, name_, "the interface is not set up for CAN FD",
                state.has_controller
                    ? fmt::format("ip link set {0} down && ip link set {0} up type can bitrate "
                                  "1000000 dbitrate 5000000 fd on; or leave fd=1 out",
                                  interface_)
                    : fmt::format("ip link set {0} down && ip link set {0} mtu 72 up; or leave "
                                  "fd=1 out",
                                  interface_));
  }
  FileDescriptor socket = open_socket(interface_, state.index);
  FileDescriptor first = open_socket(interface_, state.index);
  const int number = socket.get();
  const int yes = 1;
  const can_err_mask_t errors = CAN_ERR_BUSOFF | CAN_ERR_CRTL | CAN_ERR_RESTARTED | CAN_ERR_ACK |
                                CAN_ERR_TX_TIMEOUT | CAN_ERR_BUSERROR | CAN_ERR_PROT;
  bool set = set_option(number, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, yes) &&
             set_option(number, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, errors) &&
             set_option(number, SOL_SOCKET, SO_TIMESTAMPNS, yes) &&
             set_option(number, SOL_SOCKET, SO_RXQ_OVFL, yes) &&
             set_option(number, SOL_SOCKET, SO_RCVBUF, receive_buffer) &&
             set_option(number, SOL_SOCKET, SO_SNDBUF, least_send_buffer) &&
             set_option(first.get(), SOL_SOCKET, SO_PRIORITY, highest_priority);
  if (!set) fail(interface_, errno);
  simulated_ = !state.has_controller;
  overflows_before_ += std::exchange(overflows_, 0);  // the kernel counts from 0 for each socket
  descriptor_ = std::move(socket);
  first_ = std::move(first);
}

void CanSocket::close() noexcept {
  descriptor_.reset();
  first_.reset();
}

bool CanSocket::hear(const std::vector<std::uint32_t>& ids) {
  std::vector<can_filter> filters;
  filters.reserve(ids.size() + 1);
  for (const std::uint32_t id : ids) {
    filters.push_back({id, CAN_SFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG});
    if (id != emergency_stop_id) continue;
    constexpr std::uint32_t no_number = CAN_EFF_MASK & ~short_stop_number(CAN_EFF_MASK);
    filters.push_back(
        {numbered_stop_id(0) | CAN_EFF_FLAG, no_number | CAN_EFF_FLAG | CAN_RTR_FLAG});
  }
  return ::setsockopt(descriptor_.get(), SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(),
                      static_cast<socklen_t>(filters.size() * sizeof(can_filter))) == 0;
}

bool CanSocket::hear_everything() {
  const can_filter all{0, 0};
  return set_option(descriptor_.get(), SOL_CAN_RAW, CAN_RAW_FILTER, all);
}

int CanSocket::receive(std::array<Received, batch>& frames) {
  auto& [raw, parts, messages, controls] = *inbox_;
  const int count = ::recvmmsg(descriptor_.get(), messages.data(), batch, MSG_DONTWAIT, nullptr);
  if (count < 0) return -errno;

  // Read the steady clock first: a delay between the readings makes frames older, never younger.
  const Clock::time_point now = Clock::now();
  timespec real{};
  ::clock_gettime(CLOCK_REALTIME, &real);
  const auto since_epoch = [](const timespec& t) {
    return std::chrono::seconds(t.tv_sec) + std::chrono::nanoseconds(t.tv_nsec);
  };
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
    Received& received = frames[i];
    received.at = now;
    for (cmsghdr* item = CMSG_FIRSTHDR(&messages[i].msg_hdr); item != nullptr;
         item = CMSG_NXTHDR(&messages[i].msg_hdr, item)) {
      if (item->cmsg_level != SOL_SOCKET) continue;
      if (item->cmsg_type == SO_TIMESTAMPNS) {
        timespec came{};
        std::memcpy(&came, CMSG_DATA(item), sizeof came);
        const auto age = since_epoch(real) - since_epoch(came);
        // The wall clock may have been set meanwhile.
        received.at = now - std::clamp<std::chrono::nanoseconds>(age, {}, std::chrono::seconds(1));
      } else if (item->cmsg_type == SO_RXQ_OVFL) {
        std::memcpy(&overflows_, CMSG_DATA(item), sizeof overflows_);
      }
    }
    messages[i].msg_hdr.msg_controllen = control_size;  // the kernel has overwritten it
    received.error = (raw[i].can_id & CAN_ERR_FLAG) != 0 ? raw[i].can_id & CAN_ERR_MASK : 0;
    received.local = (messages[i].msg_hdr.msg_flags & MSG_DONTROUTE) != 0;
    received.frame = from_kernel(raw[i], messages[i].msg_len == CANFD_MTU);
    if (received.frame.fd && (raw[i].flags & CANFD_BRS) != 0) heard_rate_switch_ = true;
  }
  return count;
}

CanSocket::Outcome CanSocket::send(const CanFrame* frames, std::size_t count, std::size_t& sent) {
  std::array<canfd_frame, batch> raw;
  std::array<iovec, batch> parts;
  std::array<mmsghdr, batch> messages;
  sent = 0;
  while (sent < count) {
    const std::size_t now = std::min(count - sent, batch);
    for (std::size_t i = 0; i < now; ++i) {
      const CanFrame& frame = frames[sent + i];
      raw[i] = to_kernel(frame);
      parts[i] = {&raw[i], frame.fd ? CANFD_MTU : CAN_MTU};
      messages[i] = {};
      messages[i].msg_hdr.msg_iov = &parts[i];
      messages[i].msg_hdr.msg_iovlen = 1;
    }
    const int taken =
        ::sendmmsg(descriptor_.get(), messages.data(), static_cast<unsigned>(now), MSG_DONTWAIT);
    if (taken < 0) return outcome_of(errno);
    sent += static_cast<std::size_t>(taken);
    // After a partial send, the next call reports the reason.
  }
  return Outcome::done;
}

CanSocket::Outcome CanSocket::send_first(const CanFrame& frame) {
  const canfd_frame raw = to_kernel(frame);
  const ssize_t size = frame.fd ? CANFD_MTU : CAN_MTU;
  if (::write(first_.get(), &raw, static_cast<std::size_t>(size)) == size) return Outcome::done;
  return outcome_of(errno);
}

}  // namespace r4
