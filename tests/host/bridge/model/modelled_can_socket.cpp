// SPDX-License-Identifier: GPL-3.0-or-later
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <string>
#include <system_error>
#include <type_traits>
#include <utility>

#include "modelled_controller.hpp"
#include "transports/can/can_socket.hpp"

namespace r4 {
namespace test {
namespace {

static_assert(std::is_trivially_copyable_v<CanFrame>);

ModelledController* interface = nullptr;

// take: true if there was a frame. put: true if there was room for the frame.
bool take(int socket, CanFrame& frame) {
  return ::recv(socket, &frame, sizeof frame, MSG_DONTWAIT) == sizeof frame;
}
bool put(int socket, const CanFrame& frame) {
  return ::send(socket, &frame, sizeof frame, MSG_DONTWAIT | MSG_NOSIGNAL) == sizeof frame;
}

// The program's end and the kernel's end, with the smallest possible buffer between them.
std::pair<FileDescriptor, FileDescriptor> make_socket() {
  std::array<int, 2> ends{};
  const int least = 1;
  if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()) != 0 ||
      ::setsockopt(ends[0], SOL_SOCKET, SO_SNDBUF, &least, sizeof least) != 0) {
    throw std::system_error(errno, std::generic_category(), "the model of a CAN socket");
  }
  return {FileDescriptor(ends[0]), FileDescriptor(ends[1])};
}

}  // namespace

ModelledController::ModelledController(CanBusModel& bus, const ControllerOptions& options)
    : bus_(bus), options_(options) {
  CanNodeOptions node;
  node.queue = options.queue;
  node.room = options.room + options.kept;
  node.sent = [this](const CanFrame&) { bus_.at(bus_.now_ns(), [this] { pump(); }); };
  node.received = [this](const CanFrame& frame) { put(rest_.get(), frame); };
  node_ = bus.add_node(std::move(node));
  interface = this;
}

ModelledController::~ModelledController() { interface = nullptr; }

void ModelledController::connect(FileDescriptor first, FileDescriptor rest) {
  first_ = std::move(first);
  rest_ = std::move(rest);
}

void ModelledController::pump() {
  CanFrame frame{};
  while (waiting() < options_.room + options_.kept && take(first_.get(), frame)) {
    bus_.send(node_, frame);
  }
  while (waiting() < options_.room && take(rest_.get(), frame)) bus_.send(node_, frame);
}

}  // namespace test

struct CanSocket::Inbox {};

CanSocket::CanSocket(std::string interface, bool fd)
    : interface_(std::move(interface)), name_("can://" + interface_), fd_(fd) {}
CanSocket::~CanSocket() = default;

std::string CanSocket::state() const { return ""; }
Problem CanSocket::problem(int error) const {
  return {ErrorKind::open, name_, std::strerror(error), ""};
}

void CanSocket::open() {
  static_cast<void>(fd_);  // the model does not distinguish classic CAN from CAN FD
  auto [first, first_of_kernel] = test::make_socket();
  auto [rest, rest_of_kernel] = test::make_socket();
  first_ = std::move(first);
  descriptor_ = std::move(rest);
  test::interface->connect(std::move(first_of_kernel), std::move(rest_of_kernel));
}

void CanSocket::close() noexcept {
  descriptor_.reset();
  first_.reset();
}

bool CanSocket::hear(const std::vector<std::uint32_t>&) { return true; }
bool CanSocket::hear_everything() { return true; }

int CanSocket::receive(std::array<Received, batch>& frames) {
  int count = 0;
  for (Received& each : frames) {
    each = Received();
    if (!test::take(descriptor_.get(), each.frame)) break;
    each.at = Clock::now();
    ++count;
  }
  return count == 0 ? -EAGAIN : count;
}

CanSocket::Outcome CanSocket::send(const CanFrame* frames, std::size_t count, std::size_t& sent) {
  for (sent = 0; sent < count; ++sent) {
    if (!test::put(descriptor_.get(), frames[sent])) return Outcome::busy;
  }
  return Outcome::done;
}

CanSocket::Outcome CanSocket::send_first(const CanFrame& frame) {
  return test::put(first_.get(), frame) ? Outcome::done : Outcome::busy;
}

}  // namespace r4
