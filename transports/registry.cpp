// SPDX-License-Identifier: GPL-3.0-or-later
#include "registry.hpp"

#include <algorithm>
#include <utility>

#include "can/can_carrier.hpp"
#include "file_descriptor.hpp"
#include "serial/pty_carrier.hpp"
#include "serial/serial_carrier.hpp"
#include "share/share_group.hpp"
#include "share/shared_carrier.hpp"
#include "udp/udp_carrier.hpp"

namespace r4 {

Registry Registry::standard() {
  Registry registry;
  registry.add({"udp", "udp://HOST[:2018][?listen=2390&local=ADDRESS], udp:auto, udp:?id=NAME",
                "WiFi or Ethernet; for a board: udp://BIND[:2018][?peer=HOST[:2390]]",
                make_udp_carrier, udp_share_name, udp_has_own_port, make_claimed_udp_carrier});
  registry.add({"serial", "serial:///dev/ttyACM0[?baud=1000000], serial:auto, serial:?sn=SERIAL",
                "USB serial, or the pty of a simulated board", make_serial_carrier,
                serial_share_name, nullptr, make_claimed_serial_carrier});
  registry.add(
      {"pty", "pty:[PATH]", "for a board: a pty that a host opens as serial", make_pty_carrier});
  registry.add({"can", "can://can0[?node=1&fd=0&pack=1]", "ISO-TP on a CAN bus (SocketCAN)",
                make_can_carrier, can_share_name});
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
  return with_system_errors(parsed.text(), [&] { return entry.make(io, parsed, role); });
}

std::unique_ptr<Carrier> Registry::make_shared(asio::io_context& io, std::string_view url,
                                               BoardRole role) const {
  Url parsed = Url::parse(url);
  const Entry& entry = entry_of(parsed);
  if (!entry.share_name) return entry.make(io, parsed, Role::host);
  ShareGroup group = take_share_group(parsed);
  if (entry.own && entry.own(parsed)) return entry.make(io, parsed, Role::host);
  auto claim = std::make_shared<DeviceClaim>();
  auto carrier = entry.make_claimed ? entry.make_claimed(io, parsed, claim)
                                    : entry.make(io, parsed, Role::host);
  FindShareName find = [name_of = entry.share_name, parsed = std::move(parsed),
                        group = std::move(group)] {
    ShareName found = name_of(parsed);
    found.group = group;
    return found;
  };
  return make_shared_carrier(io, std::move(carrier), std::move(claim), std::move(find), role);
}

}  // namespace r4
