// SPDX-License-Identifier: GPL-3.0-or-later
#include "network_watch.hpp"

#include <linux/netlink.h>
#include <linux/rtnetlink.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>

namespace r4 {
namespace {

constexpr int most_in_a_turn = 64;

}  // namespace

asio::execution_context::id NetworkWatch::id;

NetworkWatch::NetworkWatch(asio::execution_context& context)
    : service(context), waits_(static_cast<asio::io_context&>(context)) {}

void NetworkWatch::shutdown() noexcept {
  if (waits_.is_open()) waits_.release();
}

void NetworkWatch::enter(Member& member) {
  if (members_.empty()) open();
  members_.push_back(&member);
}

void NetworkWatch::leave(Member& member) {
  std::replace(members_.begin(), members_.end(), &member, static_cast<Member*>(nullptr));
  if (std::any_of(members_.begin(), members_.end(), [](const Member* each) { return each; }))
    return;
  // Without members, the watch must not keep the loop running.
  members_.clear();
  waiting_.cancel();
  if (waits_.is_open()) waits_.release();
  changes_.reset();
}

void NetworkWatch::open() {
  changes_.reset(::socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, NETLINK_ROUTE));
  if (!changes_) return;
  sockaddr_nl all{};
  all.nl_family = AF_NETLINK;
  all.nl_groups = RTMGRP_LINK | RTMGRP_IPV4_IFADDR | RTMGRP_IPV6_IFADDR;
  if (::bind(changes_.get(), reinterpret_cast<const sockaddr*>(&all), sizeof all) != 0) return;
  asio::error_code error;
  waits_.assign(changes_.get(), error);
  if (!error) wait();
}

void NetworkWatch::wait() {
  waits_.async_wait(asio::posix::descriptor_base::wait_read, waiting_.handler([this] { tell(); }));
}

// Looks up all addresses, because reports may be lost, and one change may cause many reports.
void NetworkWatch::tell() {
  std::array<char, 4096> report;
  for (int i = 0; i < most_in_a_turn; ++i) {
    if (::recv(changes_.get(), report.data(), report.size(), MSG_TRUNC) <= 0) break;
  }
  const std::vector<OwnAddress> own = own_addresses();
  std::size_t next = 0;  // members may enter and leave meanwhile
  while (next < members_.size()) {
    Member* const member = members_[next++];
    if (member != nullptr) member->on_network_change(own);
  }
  members_.erase(std::remove(members_.begin(), members_.end(), nullptr), members_.end());
  if (!members_.empty()) wait();
}

}  // namespace r4
