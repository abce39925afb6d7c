// SPDX-License-Identifier: GPL-3.0-or-later
#include "packet_address.hpp"

#include <netinet/in.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstring>

namespace r4 {
namespace {

using asio::ip::address;
using Endpoint = asio::ip::udp::endpoint;

constexpr std::size_t control_size = CMSG_SPACE(sizeof(in6_pktinfo));

address address_of(const cmsghdr& item) {
  if (item.cmsg_level == IPPROTO_IP && item.cmsg_type == IP_PKTINFO) {
    in_pktinfo info{};
    std::memcpy(&info, CMSG_DATA(&item), sizeof info);
    // An address of this computer, also for a broadcast.
    return asio::ip::address_v4(ntohl(info.ipi_spec_dst.s_addr));
  }
  if (item.cmsg_level == IPPROTO_IPV6 && item.cmsg_type == IPV6_PKTINFO) {
    in6_pktinfo info{};
    std::memcpy(&info, CMSG_DATA(&item), sizeof info);
    asio::ip::address_v6::bytes_type bytes;
    std::memcpy(bytes.data(), &info.ipi6_addr, bytes.size());
    const asio::ip::address_v6 at(bytes);
    if (!at.is_multicast()) return at;
  }
  return {};
}

template <class Info>
void put(msghdr& message, int level, int type, const Info& info) {
  message.msg_controllen = CMSG_SPACE(sizeof info);
  cmsghdr* const item = CMSG_FIRSTHDR(&message);
  item->cmsg_level = level;
  item->cmsg_type = type;
  item->cmsg_len = CMSG_LEN(sizeof info);
  std::memcpy(CMSG_DATA(item), &info, sizeof info);
}

}  // namespace

void note_addresses(int socket, const asio::ip::udp& protocol) {
  const bool v6 = protocol == asio::ip::udp::v6();
  const int yes = 1;
  ::setsockopt(socket, v6 ? static_cast<int>(IPPROTO_IPV6) : static_cast<int>(IPPROTO_IP),
               v6 ? IPV6_RECVPKTINFO : IP_PKTINFO, &yes, sizeof yes);
}

// NOLINTNEXTLINE(readability-non-const-parameter): the kernel writes to it
std::optional<std::size_t> receive_packet(int socket, char* out, std::size_t room, Endpoint& from,
                                          address& at) {
  alignas(cmsghdr) char control[control_size];
  iovec part{out, room};
  msghdr message{};
  message.msg_name = from.data();
  message.msg_namelen = static_cast<socklen_t>(from.capacity());
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control;
  message.msg_controllen = sizeof control;
  const ssize_t size = ::recvmsg(socket, &message, MSG_DONTWAIT | MSG_TRUNC);
  if (size < 0) return std::nullopt;
  from.resize(message.msg_namelen);
  const cmsghdr* const item = CMSG_FIRSTHDR(&message);
  at = item != nullptr ? address_of(*item) : address();
  return static_cast<std::size_t>(size);
}

int send_packet(int socket, std::string_view bytes, const Endpoint& to, const address& from) {
  alignas(cmsghdr) char control[control_size] = {};
  // The kernel only reads the buffers.
  iovec part{const_cast<char*>(bytes.data()), bytes.size()};  // NOLINT
  msghdr message{};
  message.msg_name = const_cast<void*>(static_cast<const void*>(to.data()));  // NOLINT
  message.msg_namelen = static_cast<socklen_t>(to.size());
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control;
  if (from.is_v4() && !from.is_unspecified()) {
    in_pktinfo info{};
    info.ipi_spec_dst.s_addr = htonl(from.to_v4().to_uint());
    put(message, IPPROTO_IP, IP_PKTINFO, info);
  } else if (from.is_v6() && !from.is_unspecified()) {
    in6_pktinfo info{};
    const auto address_bytes = from.to_v6().to_bytes();
    std::memcpy(&info.ipi6_addr, address_bytes.data(), address_bytes.size());
    put(message, IPPROTO_IPV6, IPV6_PKTINFO, info);
  }
  const auto send = [&] {
    return ::sendmsg(socket, &message, MSG_DONTWAIT | MSG_NOSIGNAL) >= 0 ? 0 : errno;
  };
  const int error = send();
  if (message.msg_controllen == 0 || (error != EINVAL && error != EADDRNOTAVAIL)) return error;
  message.msg_controllen = 0;  // this computer may have lost that address
  return send();
}

}  // namespace r4
