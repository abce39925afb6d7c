// SPDX-License-Identifier: GPL-3.0-or-later
#include "this_computer.hpp"

#include <ifaddrs.h>
#include <linux/filter.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/select.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <system_error>

#include "r4link/error.hpp"

namespace r4::tool::ros2 {
namespace {

constexpr std::size_t most_interfaces = 4;  // as Cyclone DDS

// Cyclone uses only descriptors below FD_SETSIZE.
std::vector<int> udp_sockets() {
  std::vector<int> sockets;
  for (int each = 0; each < FD_SETSIZE; ++each) {
    int protocol = 0;
    socklen_t size = sizeof protocol;
    const int result = ::getsockopt(each, SOL_SOCKET, SO_PROTOCOL, &protocol, &size);
    if (result == 0 && protocol == IPPROTO_UDP) sockets.push_back(each);
  }
  return sockets;
}

}  // namespace

std::vector<std::string> interfaces_of_this_computer() {
  std::vector<std::string> names{"lo"};
  ifaddrs* first = nullptr;
  if (::getifaddrs(&first) != 0) return names;
  for (const ifaddrs* each = first; each != nullptr; each = each->ifa_next) {
    const bool ipv4 = each->ifa_addr != nullptr && each->ifa_addr->sa_family == AF_INET;
    const bool up = (each->ifa_flags & IFF_UP) != 0;
    if (!ipv4 || !up || names.size() == most_interfaces) continue;
    if (std::find(names.begin(), names.end(), each->ifa_name) == names.end()) {
      names.emplace_back(each->ifa_name);
    }
  }
  ::freeifaddrs(first);
  return names;
}

OnlyThisComputer::OnlyThisComputer() : before_(udp_sockets()) {}

void OnlyThisComputer::limit() const {
  constexpr auto interface = static_cast<std::uint32_t>(SKF_AD_OFF + SKF_AD_IFINDEX);
  sock_filter program[] = {
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, interface),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, ::if_nametoindex("lo"), 0, 1),
      BPF_STMT(BPF_RET | BPF_K, 0xFFFFFFFF),  // the whole packet
      BPF_STMT(BPF_RET | BPF_K, 0),
  };
  const sock_fprog filter{std::size(program), program};
  for (const int each : udp_sockets()) {
    if (std::find(before_.begin(), before_.end(), each) != before_.end()) continue;
    if (::setsockopt(each, SOL_SOCKET, SO_ATTACH_FILTER, &filter, sizeof filter) != 0) {
      throw Error(ErrorKind::open, "r4 ros2",
                  "cannot be limited to this computer: " +
                      std::error_code(errno, std::generic_category()).message(),
                  "use a kernel with socket filters, or open the graph to the network: "
                  "ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET");
    }
  }
}

}  // namespace r4::tool::ros2
