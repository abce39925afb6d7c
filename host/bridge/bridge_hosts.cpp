// SPDX-License-Identifier: GPL-3.0-or-later
#include "bridge_hosts.hpp"

#include <algorithm>

namespace r4 {

BridgeHosts::Heartbeat BridgeHosts::on_heartbeat(Peer from, SessionId sid, Time now) {
  Host* free = nullptr;
  for (Host& host : hosts_) {
    const bool heard = is_heard(host, now);
    if (heard && host.sid == sid && host.peer == from) {
      host.heard = now;
      return Heartbeat::known;
    }
    if (heard && host.sid == sid && sid == no_session) return Heartbeat::kept_out;
    if (!heard && free == nullptr) free = &host;
  }
  if (free == nullptr) return Heartbeat::kept_out;
  *free = Host{true, from, sid, now, Time()};
  return Heartbeat::added;
}

bool BridgeHosts::knows(Peer from, SessionId sid, Time now) const {
  return std::any_of(hosts_.begin(), hosts_.end(), [&](const Host& host) {
    return is_heard(host, now) && host.sid == sid && host.peer == from;
  });
}

bool BridgeHosts::on_busy(SessionId sid, Time now) {
  bool served = false;
  for (Host& host : hosts_) {
    if (host.sid != sid || !is_heard(host, now)) continue;
    served = served || is_served(host, now);
    host.refused_until = now + refusal;
  }
  return served;
}

bool BridgeHosts::serves_any(Time now) const {
  return std::any_of(hosts_.begin(), hosts_.end(),
                     [&](const Host& host) { return is_served(host, now); });
}

bool BridgeHosts::serves(Peer peer, Time now) const {
  return std::any_of(hosts_.begin(), hosts_.end(),
                     [&](const Host& host) { return host.peer == peer && is_served(host, now); });
}

}  // namespace r4
