// SPDX-License-Identifier: GPL-3.0-or-later
#include "network_watch.hpp"

#include <linux/netlink.h>
#include <linux/rtnetlink.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <utility>

#include "../../file_descriptor.hpp"

namespace r4 {
namespace {

constexpr int most_in_a_turn = 64;

}  // namespace

asio::execution_context::id NetworkWatch::id;

NetworkWatch::NetworkWatch(asio::execution_context& context)
    : service(context), changes_(static_cast<asio::io_context&>(context)) {}

void NetworkWatch::shutdown() noexcept {
  asio::error_code ignored;
  changes_.close(ignored);
}

void NetworkWatch::enter(Member& member) {
  if (members_.empty()) open();
  members_.push_back(&member);
}

void NetworkWatch::leave(Member& member) {
  std::erase(members_, &member);
  if (!members_.empty()) return;
  // Without members, the watch must not keep the loop running.
  waiting_.cancel();
  shutdown();
}

void NetworkWatch::open() {
  FileDescriptor changes(
      ::socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, NETLINK_ROUTE));
  sockaddr_nl all{};
  all.nl_family = AF_NETLINK;
  all.nl_groups = RTMGRP_LINK | RTMGRP_IPV4_IFADDR | RTMGRP_IPV6_IFADDR;
  if (::bind(changes.get(), reinterpret_cast<const sockaddr*>(&all), sizeof all) != 0) return;
  if (give_to_loop(changes_, std::move(changes))) wait();
}

void NetworkWatch::wait() {
  changes_.async_wait(asio::posix::descriptor_base::wait_read,
                      waiting_.handler([this] { tell(); }));
}

// Looks up all addresses, because reports may be lost, and one change may cause many reports.
void NetworkWatch::tell() {
  std::array<char, 4096> report;
  for (int i = 0; i < most_in_a_turn; ++i) {
    if (::recv(changes_.native_handle(), report.data(), report.size(), MSG_TRUNC) <= 0) break;
  }
  const std::vector<OwnAddress> own = own_addresses();
  const std::vector<Member*> notified = members_;  // members may enter and leave meanwhile
  for (Member* const member : notified) {
    const bool is_here = std::find(members_.begin(), members_.end(), member) != members_.end();
    if (is_here) member->on_network_change(own);
  }
  if (!members_.empty()) wait();
}

}  // namespace r4
