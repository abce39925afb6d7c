// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/can/can_interface.hpp"

#include <fmt/format.h>
#include <linux/can.h>
#include <linux/can/netlink.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <netlink/cache.h>
#include <netlink/errno.h>
#include <netlink/netlink.h>
#include <netlink/route/link.h>
#include <netlink/route/link/can.h>
#include <netlink/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <iterator>
#include <memory>
#include <string_view>
#include <utility>

#include "../file_descriptor.hpp"

namespace r4 {
namespace {

using Netlink = std::unique_ptr<nl_sock, decltype(&nl_socket_free)>;
using Link = std::unique_ptr<rtnl_link, decltype(&rtnl_link_put)>;
using Links = std::unique_ptr<nl_cache, decltype(&nl_cache_free)>;

// 0, or libnl's negative error.
int connect(const Netlink& netlink) {
  return netlink ? nl_connect(netlink.get(), NETLINK_ROUTE) : -NLE_NOMEM;
}

void describe_controller(rtnl_link* link, CanInterface& result) {
  constexpr const char* states[] = {"error-active", "error-warning", "error-passive",
                                    "bus-off",      "stopped",       "sleeping"};
  std::uint32_t state = 0;
  if (rtnl_link_can_state(link, &state) >= 0 && state < std::size(states)) {
    result.state = states[state];
  }
  can_bittiming timing{};
  if (rtnl_link_can_get_bittiming(link, &timing) >= 0) result.bit_rate = timing.bitrate;
#if LIBNL_VER_NUM >= LIBNL_VER(3, 6)
  if (rtnl_link_can_get_data_bittiming(link, &timing) >= 0) result.data_bit_rate = timing.bitrate;
#endif
  std::uint32_t restart_ms = 0;
  if (rtnl_link_can_get_restart_ms(link, &restart_ms) >= 0) result.restart_ms = restart_ms;
  can_berr_counter errors{};
  if (rtnl_link_can_berr(link, &errors) >= 0) {
    result.tx_errors = errors.txerr;
    result.rx_errors = errors.rxerr;
  }
}

CanInterface describe(rtnl_link* link) {
  CanInterface result;
  result.name = rtnl_link_get_name(link);
  result.exists = true;
  result.index = rtnl_link_get_ifindex(link);
  result.is_can = rtnl_link_get_arptype(link) == ARPHRD_CAN;
  result.up = (rtnl_link_get_flags(link) & IFF_UP) != 0;
  result.tx_queue = rtnl_link_get_txqlen(link);
  result.fd = rtnl_link_get_mtu(link) >= CANFD_MTU;
  const char* const type = rtnl_link_get_type(link);  // null: an slcan of a kernel before 6.0
  const bool is_virtual =
      type != nullptr && (std::string_view(type) == "vcan" || std::string_view(type) == "vxcan");
  result.has_controller = result.is_can && !is_virtual;
  if (rtnl_link_is_can(link) != 0) describe_controller(link, result);
  return result;
}

}  // namespace

CanInterface can_interface(const std::string& name) {
  CanInterface result;
  result.name = name;
  if (name.empty() || name.size() >= IFNAMSIZ) return result;
  const Netlink netlink(nl_socket_alloc(), nl_socket_free);
  rtnl_link* found = nullptr;
  int error = connect(netlink);
  if (error == 0) error = rtnl_link_get_kernel(netlink.get(), 0, name.c_str(), &found);
  if (error == 0) return describe(Link(found, rtnl_link_put).get());
  if (error != -NLE_NODEV && error != -NLE_OBJ_NOTFOUND) result.unknown = nl_geterror(error);
  return result;
}

const std::string& can_interface_of(const Url& url) {
  if (url.scheme() != "can" || url.host().empty() || !url.path().empty() || url.port()) {
    throw Error(ErrorKind::usage, url.text(), "the URL is not can://INTERFACE",
                "write a URL such as can://can0");
  }
  return url.host();
}

std::vector<CanInterface> list_can_interfaces() {
  std::vector<CanInterface> result;
  const Netlink netlink(nl_socket_alloc(), nl_socket_free);
  nl_cache* all = nullptr;
  if (connect(netlink) < 0 || rtnl_link_alloc_cache(netlink.get(), AF_UNSPEC, &all) < 0) {
    return result;
  }
  const Links links(all, nl_cache_free);
  for (nl_object* each = nl_cache_get_first(all); each != nullptr; each = nl_cache_get_next(each)) {
    auto* const link = reinterpret_cast<rtnl_link*>(each);  // as libnl does
    if (rtnl_link_get_arptype(link) == ARPHRD_CAN) result.push_back(describe(link));
  }
  std::sort(result.begin(), result.end(),
            [](const CanInterface& a, const CanInterface& b) { return a.name < b.name; });
  return result;
}

Problem can_problem(const std::string& interface, int error) {
  const std::string thing = "can://" + interface;
  if (auto problem = out_of_resources(thing, error)) return std::move(*problem);
  switch (error) {
    case EAFNOSUPPORT:
    case EPROTONOSUPPORT:
      return {ErrorKind::unsupported, thing, "this kernel has no SocketCAN",
              "load it (modprobe can-raw), or run the command under tools/with-can"};
    case ENODEV:
    case ENXIO:
      return {
          ErrorKind::unsupported, thing, "there is no interface " + interface,
          fmt::format("plug its adapter in, or make a virtual one: ip link add {0} type vcan && "
                      "ip link set {0} up",
                      interface)};
    case ENETDOWN:
      return {
          ErrorKind::open, thing, "the interface is down",
          fmt::format(
              "ip link set {} up{}", interface,
              can_interface(interface).has_controller
                  ? " txqueuelen 1000 type can bitrate 1000000 sample-point 0.875 restart-ms 100"
                  : "")};
    case EPERM:
    case EACCES:
      return {ErrorKind::permission, thing, std::strerror(error),
              "run it as a user who may open raw CAN sockets"};
    default:
      return {ErrorKind::open, thing, std::strerror(error), ""};
  }
}

}  // namespace r4
