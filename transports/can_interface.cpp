// SPDX-License-Identifier: GPL-3.0-or-later
#include "can_interface.hpp"

#include <linux/can.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

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

std::string bring_up_fix(const std::string& name) {
  const CanInterface interface = can_interface(name);
  return "ip link set " + name + " up" +
         (interface.has_controller ? " txqueuelen 1000 type can bitrate 1000000 restart-ms 100"
                                   : "");
}

}  // namespace r4
