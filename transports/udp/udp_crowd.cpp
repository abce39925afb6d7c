// SPDX-License-Identifier: GPL-3.0-or-later
#include "udp_crowd.hpp"

#include <sys/epoll.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>

#include "r4link/datagram.hpp"

namespace r4 {
namespace {

// Where more than this comes in a window, each packet of hundreds of boards would wake the thread.
constexpr std::chrono::milliseconds window{10};
constexpr std::size_t busy_window = 200;

// Others of the loop wait.
constexpr int most_rounds = 4;

}  // namespace

asio::execution_context::id UdpCrowd::id;

// What the kernel fills in, the same memory for all members, so that it is in the cache.
struct UdpCrowd::Batch {
  static constexpr std::size_t packets = 8;

  Batch() {
    for (std::size_t i = 0; i < packets; ++i) {
      parts[i] = {bytes[i].data(), bytes[i].size()};
      messages[i].msg_hdr.msg_name = from[i].data();
      messages[i].msg_hdr.msg_iov = &parts[i];
      messages[i].msg_hdr.msg_iovlen = 1;
    }
  }

  std::array<epoll_event, 64> events{};
  std::size_t found = 0;  // of them, those that hold something
  std::array<mmsghdr, packets> messages{};
  std::array<iovec, packets> parts{};
  std::array<Endpoint, packets> from;
  std::array<std::array<char, max_datagram>, packets> bytes{};
};

UdpCrowd::UdpCrowd(asio::execution_context& context)
    : service(context), io_(static_cast<asio::io_context&>(context)), idle_(io_), timer_(io_) {}

UdpCrowd::~UdpCrowd() = default;

void UdpCrowd::shutdown() noexcept {
  if (idle_.is_open()) idle_.release();
}

bool UdpCrowd::enter() {
  if (++hosts_ <= few) return false;
  if (!ready_) ready_.reset(::epoll_create1(EPOLL_CLOEXEC));
  if (!batch_) batch_ = std::make_unique<Batch>();
  return static_cast<bool>(ready_);
}

bool UdpCrowd::read(int socket, Member& member) {
  // Told once of what comes: drain() leaves nothing behind.
  epoll_event event{};
  event.events = EPOLLIN | EPOLLET;
  event.data.ptr = &member;
  if (::epoll_ctl(ready_.get(), EPOLL_CTL_ADD, socket, &event) != 0) return false;
  member.watched_ = socket;
  if (++members_ == 1) wait();
  return true;
}

void UdpCrowd::stop(Member& member) {
  if (member.watched_ < 0) return;
  ::epoll_ctl(ready_.get(), EPOLL_CTL_DEL, std::exchange(member.watched_, -1), nullptr);
  for (std::size_t i = 0; i < batch_->found; ++i) {
    if (batch_->events[i].data.ptr == &member) batch_->events[i].data.ptr = nullptr;
  }
  if (--members_ != 0) return;
  // Nothing that the loop would have to wait for.
  waiting_.cancel();
  timer_.cancel();
  if (idle_.is_open()) idle_.release();
  busy_ = false;
}

void UdpCrowd::wait() {
  if (busy_) {
    // The loop's reactor would wake up for what comes meanwhile.
    if (idle_.is_open()) idle_.release();
  } else if (!idle_.is_open()) {
    asio::error_code
        ignored;  // where the system lets the loop wait for nothing more, it looks again and again
    idle_.assign(ready_.get(), ignored);
  }
  if (idle_.is_open()) {
    idle_.async_wait(asio::posix::descriptor_base::wait_read, waiting_.handler([this] { turn(); }));
  } else {
    timer_.expires_after(pause);
    timer_.async_wait(waiting_.handler([this] { turn(); }));
  }
}

void UdpCrowd::turn() {
  Batch& batch = *batch_;
  for (int round = 0; round < most_rounds; ++round) {
    const int found =
        ::epoll_wait(ready_.get(), batch.events.data(), static_cast<int>(batch.events.size()), 0);
    batch.found = found > 0 ? static_cast<std::size_t>(found) : 0;
    bool more = batch.found == batch.events.size();
    for (std::size_t i = 0; i < batch.found; ++i) more |= !drain(i);
    batch.found = 0;
    if (!more) break;
  }
  count_packets();
  if (members_ != 0) wait();
}

// True if it left nothing. One that floods gets a further round behind the others.
bool UdpCrowd::drain(std::size_t event) {
  Batch& batch = *batch_;
  Member* const member = static_cast<Member*>(batch.events[event].data.ptr);
  const auto stopped = [&] { return batch.events[event].data.ptr == nullptr; };
  if (stopped()) return true;
  for (mmsghdr& each : batch.messages) {
    each.msg_hdr.msg_namelen = static_cast<socklen_t>(batch.from[0].capacity());
  }
  const int got = ::recvmmsg(member->watched_, batch.messages.data(), Batch::packets,
                             MSG_DONTWAIT | MSG_TRUNC, nullptr);
  const bool drained = got < 0 ? errno == EAGAIN : static_cast<std::size_t>(got) < Batch::packets;
  for (int i = 0; i < got && !stopped(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    batch.from[at].resize(batch.messages[at].msg_hdr.msg_namelen);
    ++packets_;
    member->on_packet({batch.bytes[at].data(), batch.messages[at].msg_len}, batch.from[at]);
  }
  if (stopped()) return true;
  if (drained) {
    member->on_all_read();
    return true;
  }
  epoll_event again{};
  again.events = EPOLLIN | EPOLLET;
  again.data.ptr = member;
  ::epoll_ctl(ready_.get(), EPOLL_CTL_MOD, member->watched_, &again);
  return false;
}

void UdpCrowd::count_packets() {
  const auto now = std::chrono::steady_clock::now();
  if (now - since_ < window) return;
  busy_ = packets_ >= busy_window && now - since_ < 2 * window;
  since_ = now;
  packets_ = 0;
}

}  // namespace r4
