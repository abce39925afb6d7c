// SPDX-License-Identifier: GPL-3.0-or-later
#include "can_interface.hpp"

#include <fmt/format.h>
#include <libsocketcan.h>
#include <linux/can.h>
#include <linux/ethtool.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <string_view>
#include <utility>

#include "file_descriptor.hpp"

namespace r4 {

namespace {

// vcan and vxcan have no controller; their driver's name is the only sign of it.
bool is_virtual(int socket, ifreq request) {
  ethtool_drvinfo driver{};
  driver.cmd = ETHTOOL_GDRVINFO;
  request.ifr_data = reinterpret_cast<char*>(&driver);
  if (::ioctl(socket, SIOCETHTOOL, &request) != 0) return true;
  return std::string_view(driver.driver) == "vcan" || std::string_view(driver.driver) == "vxcan";
}

}  // namespace

CanInterface can_interface(const std::string& name) {
  CanInterface result;
  result.name = name;
  if (name.empty() || name.size() >= IFNAMSIZ) return result;
  const FileDescriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  ifreq request{};
  std::memcpy(request.ifr_name, name.data(), name.size());
  if (!socket || ::ioctl(socket.get(), SIOCGIFINDEX, &request) != 0) return result;
  result.exists = true;
  result.index = request.ifr_ifindex;
  if (::ioctl(socket.get(), SIOCGIFHWADDR, &request) == 0) {
    result.is_can = request.ifr_hwaddr.sa_family == ARPHRD_CAN;
  }
  if (::ioctl(socket.get(), SIOCGIFFLAGS, &request) == 0) {
    result.up = (request.ifr_flags & IFF_UP) != 0;
  }
  if (::ioctl(socket.get(), SIOCGIFMTU, &request) == 0) {
    result.fd = request.ifr_mtu >= static_cast<int>(CANFD_MTU);
  }
  result.has_controller = result.is_can && !is_virtual(socket.get(), request);
  return result;
}

std::vector<CanInterface> list_can_interfaces() {
  std::vector<CanInterface> result;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator("/sys/class/net", error)) {
    CanInterface interface = can_interface(entry.path().filename());
    if (interface.is_can) result.push_back(std::move(interface));
  }
  std::sort(result.begin(), result.end(),
            [](const CanInterface& a, const CanInterface& b) { return a.name < b.name; });
  return result;
}

CanController can_controller(const CanInterface& interface) {
  CanController result;
  if (!interface.has_controller) return result;  // the library complains about those on stderr
  constexpr const char* states[] = {"error-active", "error-warning", "error-passive",
                                    "bus-off",      "stopped",       "sleeping"};
  int state = -1;
  if (::can_get_state(interface.name.c_str(), &state) == 0 && state >= 0 &&
      state < static_cast<int>(std::size(states))) {
    result.state = states[state];
  }
  can_bittiming timing{};
  if (::can_get_bittiming(interface.name.c_str(), &timing) == 0) result.bit_rate = timing.bitrate;
  return result;
}

Problem can_problem(const std::string& interface, int error) {
  const std::string thing = "can://" + interface;
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
      return {ErrorKind::open, thing, "the interface is down",
              fmt::format("ip link set {} up{}", interface,
                          can_interface(interface).has_controller
                              ? " txqueuelen 1000 type can bitrate 1000000 restart-ms 100"
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
