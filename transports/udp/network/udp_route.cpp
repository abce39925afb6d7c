// SPDX-License-Identifier: GPL-3.0-or-later
#include "udp_route.hpp"

#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>

#include "../../file_descriptor.hpp"

namespace r4 {
namespace {

using asio::ip::address;
using Endpoint = asio::ip::udp::endpoint;

Endpoint endpoint_of(const sockaddr& from) {
  Endpoint endpoint;
  if (from.sa_family == AF_INET6) endpoint = Endpoint(asio::ip::udp::v6(), 0);
  std::memcpy(endpoint.data(), &from, endpoint.size());
  return endpoint;
}

const OwnAddress* find(const std::vector<OwnAddress>& own, const address& wanted) {
  const auto found = std::find_if(
      own.begin(), own.end(), [&wanted](const OwnAddress& each) { return each.address == wanted; });
  return found == own.end() ? nullptr : &*found;
}

}  // namespace

std::vector<OwnAddress> own_addresses() {
  std::vector<OwnAddress> own;
  ifaddrs* all = nullptr;
  if (::getifaddrs(&all) != 0) return own;
  for (const ifaddrs* each = all; each != nullptr; each = each->ifa_next) {
    const sockaddr* const at = each->ifa_addr;
    if (at == nullptr || (at->sa_family != AF_INET && at->sa_family != AF_INET6)) continue;
    const auto is = [each](unsigned flag) { return (each->ifa_flags & flag) != 0; };
    OwnAddress& one = own.emplace_back();
    one.address = endpoint_of(*at).address();
    one.name = each->ifa_name;
    one.name.resize(std::min(one.name.size(), one.name.find(':')));  // without an alias
    one.interface = ::if_nametoindex(one.name.c_str());
    one.works = is(IFF_UP) && is(IFF_RUNNING);
    if (one.address.is_v6()) continue;
    if (is(IFF_LOOPBACK)) one.broadcast = one.address.to_v4();
    if (is(IFF_LOOPBACK) || !is(IFF_BROADCAST) || each->ifa_netmask == nullptr) continue;
    const std::uint32_t hosts = ~endpoint_of(*each->ifa_netmask).address().to_v4().to_uint();
    if (hosts < 3) continue;  // one or two addresses: no broadcast
    one.broadcast = asio::ip::address_v4(one.address.to_v4().to_uint() | hosts);
  }
  ::freeifaddrs(all);
  return own;
}

int probe_route(const Endpoint& to, const address& from, const std::vector<OwnAddress>& own) {
  const FileDescriptor probe(::socket(to.protocol().family(), SOCK_DGRAM | SOCK_CLOEXEC, 0));
  if (!probe) return errno;
  if (!from.is_unspecified()) {
    send_by_interface_of(from, probe.get(), to, own);
    const Endpoint local(from, 0);
    if (::bind(probe.get(), local.data(), static_cast<socklen_t>(local.size())) != 0) return errno;
  }
  if (::connect(probe.get(), to.data(), static_cast<socklen_t>(to.size())) != 0) return errno;
  Endpoint local(to.protocol(), 0);
  auto size = static_cast<socklen_t>(local.capacity());
  if (::getsockname(probe.get(), local.data(), &size) != 0) return errno;
  const OwnAddress* const source = find(own, local.address());
  const bool here = local.address() == to.address();  // the state of its interface does not matter
  return here || source == nullptr || source->works ? 0 : ENETDOWN;
}

void send_by_interface_of(const address& from, int socket, const Endpoint& to,
                          const std::vector<OwnAddress>& own) {
  const OwnAddress* const source = find(own, from);
  if (source == nullptr || find(own, to.address()) != nullptr) return;
  const std::uint32_t index = htonl(source->interface);
  const bool v6 = from.is_v6();
  ::setsockopt(socket, v6 ? static_cast<int>(IPPROTO_IPV6) : static_cast<int>(IPPROTO_IP),
               v6 ? IPV6_UNICAST_IF : IP_UNICAST_IF, &index, sizeof index);
}

}  // namespace r4
