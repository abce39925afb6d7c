// SPDX-License-Identifier: GPL-3.0-or-later
#include "bridge_hosts.hpp"

#include <algorithm>
#include <utility>

namespace r4 {

BridgeHosts::BridgeHosts(std::chrono::milliseconds timeout) : timeout_(timeout) {
  served_.reserve(hosts_.size());
  next_.reserve(hosts_.size());
}

bool BridgeHosts::on_heartbeat(Peer from, const Datagram& heartbeat, bool judged, Time now) {
  Host* const host = place_for(from, heartbeat.session_id(), now);
  if (host == nullptr) return false;
  if (!is_heard(*host, now)) {
    host->first_heartbeat.reset();
    if (heartbeat.has_pnum()) host->first_heartbeat = heartbeat.pnum();
  }
  host->heard = now;
  if (judged && now >= host->refused_until && host->served_from == never) {
    host->served_from = now + patience;
  }
  return true;
}

BridgeHosts::Host* BridgeHosts::place_for(Peer from, SessionId sid, Time now) {
  for (Host& host : hosts_) {
    if (is_of(host, from, sid)) return &host;
  }
  Host fresh;
  Host* place = nullptr;
  if (sid == no_session) {
    place = hosts_.data();
    if (place->heard != Time() && now - place->heard < timeout_ + paper_margin) return nullptr;
  } else {
    // Replaces a host that was never served, else the host that was silent longest.
    const auto rank = [now](const Host& host) {
      return std::pair(now >= host.served_from, host.heard);
    };
    for (Host& host : hosts_) {
      if (host.sid == sid) fresh = host;  // another path of the same session
      if (&host == hosts_.data() || is_served(host, now)) continue;
      if (place == nullptr || rank(host) < rank(*place)) place = &host;
    }
    if (place == nullptr) return nullptr;
  }
  *place = fresh;
  place->peer = from;
  place->sid = sid;
  return place;
}

void BridgeHosts::on_busy(SessionId sid, Time now) {
  for (Host& host : hosts_) {
    if (host.sid != sid) continue;
    host.served_from = never;
    host.refused_until = now + timeout_;
  }
}

bool BridgeHosts::poll(Time now) {
  next_.clear();
  for (const Host& host : hosts_) {
    if (!is_served(host, now)) continue;
    if (std::find(next_.begin(), next_.end(), host.peer) == next_.end()) next_.push_back(host.peer);
  }
  if (next_ == served_) return false;
  served_.swap(next_);
  return true;
}

bool BridgeHosts::knows(Peer from, SessionId sid, Time now) const {
  return std::any_of(hosts_.begin(), hosts_.end(), [&](const Host& host) {
    return is_of(host, from, sid) && is_heard(host, now);
  });
}

bool BridgeHosts::trusts(Peer from, SessionId sid, Time now) const {
  return std::any_of(hosts_.begin(), hosts_.end(), [&](const Host& host) {
    const bool same = host.sid == sid && (sid != no_session || host.peer == from);
    return same && now >= host.served_from;
  });
}

std::optional<std::uint32_t> BridgeHosts::first_heartbeat(Peer from, SessionId sid) const {
  for (const Host& host : hosts_) {
    if (is_of(host, from, sid)) return host.first_heartbeat;
  }
  return std::nullopt;
}

bool BridgeHosts::serves(SessionId sid, Time now) const {
  return std::any_of(hosts_.begin(), hosts_.end(),
                     [&](const Host& host) { return host.sid == sid && is_served(host, now); });
}

}  // namespace r4
