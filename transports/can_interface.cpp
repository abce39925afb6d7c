// SPDX-License-Identifier: GPL-3.0-or-later
#include "can_interface.hpp"

#include <fmt/format.h>
#include <linux/can.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "file_descriptor.hpp"

namespace r4 {

CanInterface can_interface(const std::string& name) {
  CanInterface result;
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
  std::error_code ignored;
  result.has_controller = std::filesystem::exists("/sys/class/net/" + name + "/device", ignored);
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
