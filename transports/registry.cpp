// SPDX-License-Identifier: GPL-3.0-or-later
#include "registry.hpp"

#include <grp.h>
#include <unistd.h>

#include <algorithm>
#include <climits>
#include <optional>
#include <utility>

#include "can/can_carrier.hpp"
#include "file_descriptor.hpp"
#include "serial/pty_carrier.hpp"
#include "serial/serial_carrier.hpp"
#include "share/shared_carrier.hpp"
#include "udp/udp_carrier.hpp"

namespace r4 {
namespace {

std::optional<gid_t> id_of(const std::string& name) {
  group entry{};
  group* found = nullptr;
  std::vector<char> room(1 << 20);  // a group may have thousands of members
  ::getgrnam_r(name.c_str(), &entry, room.data(), room.size(), &found);
  return found == nullptr ? std::nullopt : std::optional(entry.gr_gid);
}

bool is_ours(gid_t group) {
  if (::geteuid() == 0 || ::getegid() == group) return true;
  std::vector<gid_t> groups(NGROUPS_MAX);
  groups.resize(static_cast<std::size_t>(std::max(0, ::getgroups(NGROUPS_MAX, groups.data()))));
  return std::find(groups.begin(), groups.end(), group) != groups.end();
}

// Removes ?share=GROUP from the URL, and returns that group (group(5)) or an empty group. Throws
// Error{usage} for an unknown group, Error{permission} if this program's user is not a member.
ShareGroup take_share_group(Url& url) {
  const std::optional<std::string> name = url.take("share");
  if (!name) return {};
  const std::optional<gid_t> id = id_of(*name);
  if (!id) {
    throw Error(ErrorKind::usage, url.text(), "there is no group '" + *name + "' on this machine",
                "name an existing group (getent group lists them), or create one: groupadd NAME");
  }
  if (!is_ours(*id)) {
    throw Error(ErrorKind::permission, url.text(), "this user is not in the group " + *name,
                "add the user to the group (usermod -aG " + *name + " USER), and log in again");
  }
  return {*name, *id};
}

}  // namespace

Registry Registry::standard() {
  Registry registry;
  registry.add({{"udp", "udp://HOST[:2018][?listen=2390&local=ADDRESS], udp:auto, udp:?id=NAME",
                 "WiFi or Ethernet; for a board: udp://BIND[:2018][?peer=HOST[:2390]]"},
                make_udp_carrier,
                udp_share_name,
                udp_has_own_port});
  registry.add({{"serial", "serial:///dev/ttyACM0[?baud=1000000], serial:auto, serial:?sn=SERIAL",
                 "USB serial, or the pty of a simulated board"},
                make_serial_carrier,
                serial_share_name});
  registry.add(
      {{"pty", "pty:[PATH]", "for a board: a pty that a host opens as serial"}, make_pty_carrier});
  registry.add({{"can", "can://can0[?node=1&fd=0&pack=1]", "ISO-TP on a CAN bus (SocketCAN)"},
                make_can_carrier,
                can_share_name});
  return registry;
}

void Registry::add(Entry entry) { entries_.push_back(std::move(entry)); }

const Registry::Entry& Registry::entry_of(const Url& url) const {
  const auto entry = std::find_if(entries_.begin(), entries_.end(),
                                  [&](const Entry& e) { return e.scheme == url.scheme(); });
  if (entry != entries_.end()) return *entry;
  std::string known;
  for (const Entry& e : entries_) known += (known.empty() ? "" : ", ") + e.usage;
  throw Error(ErrorKind::usage, url.text(), "there is no transport '" + url.scheme() + "'",
              "use one of " + known);
}

std::unique_ptr<Carrier> Registry::make(asio::io_context& io, std::string_view url,
                                        Role role) const {
  Url parsed = Url::parse(url);
  const Entry& entry = entry_of(parsed);
  if (role == Role::host && entry.share_name) parsed.take("share");
  return with_system_errors(
      parsed.text(), [&] { return entry.make(io, parsed, role, std::make_shared<DeviceClaim>()); });
}

std::unique_ptr<Carrier> Registry::make_shared(asio::io_context& io, std::string_view url,
                                               BoardRole role) const {
  Url parsed = Url::parse(url);
  const Entry& entry = entry_of(parsed);
  const auto claim = std::make_shared<DeviceClaim>();
  ShareGroup group = entry.share_name ? take_share_group(parsed) : ShareGroup{};
  auto carrier = entry.make(io, parsed, Role::host, claim);
  if (!entry.share_name || (entry.own && entry.own(parsed))) return carrier;
  FindShareName find = [name_of = entry.share_name, parsed = std::move(parsed),
                        group = std::move(group)] {
    ShareName found = name_of(parsed);
    found.group = group;
    return found;
  };
  return make_shared_carrier(io, std::move(carrier), claim, std::move(find), role);
}

}  // namespace r4
