// SPDX-License-Identifier: GPL-3.0-or-later
// Several paths: the places of the hosts on them, the events that affect them, the old datagrams
// that are replayed on them, and the promises about paths.
#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "world_host.hpp"

namespace r4::simulation {

namespace {

constexpr std::uint32_t most_delay_us = 100'000;
constexpr std::uint64_t busy_memory_us = 300'000;
constexpr std::uint64_t used_again_us = 2'500'000;
constexpr std::uint64_t hour_us = 3'600'000'000;
constexpr std::uint64_t recorded_us = 1'000'000;

bool is_fine(const ChannelFaults& faults) {
  return faults.loss == 0 && faults.corrupt == 0 && faults.straggle == 0 &&
         faults.delay_us + faults.jitter_us <= most_delay_us;
}

}  // namespace

// The first host is on all paths. The other hosts are on some paths.
void World::place(Host& host) {
  const bool bus_stopper = host.stopper && schedule_.shared_place;
  for (int w = 0; w < schedule_.paths(); ++w) {
    if (script_ != nullptr && !script_->has_place(host.index, w)) continue;
    if (script_ == nullptr && several() && host.index != 0 &&
        (bus_stopper ? w != 0 : paths_random_.chance(0.4)))
      continue;
    Host::Place place;
    place.path = w;
    const bool shared =
        w == 0 && (bus_stopper || (host.watcher && script_ == nullptr && random_.chance(0.1)));
    place.peer = shared ? hosts_.front()->places.front().peer : next_peer_++;
    host.places.push_back(place);
  }
  if (!host.places.empty()) return;
  Host::Place place;
  place.path = schedule_.paths() - 1;
  place.peer = next_peer_++;
  host.places.push_back(place);
}

// --- events of a path

void World::disturb(int index, Happening::Kind kind, std::uint64_t end_us) {
  Path& path = paths_[index];
  std::uint64_t until_us = end_us;
  switch (kind) {
    case Happening::Kind::cut:
    case Happening::Kind::unplug:
      path.cut_to_board_until_us = path.cut_to_host_until_us = end_us;
      break;
    case Happening::Kind::cut_to_board:
      path.cut_to_board_until_us = end_us;
      break;
    case Happening::Kind::cut_to_host:
      path.cut_to_host_until_us = end_us;
      break;
    case Happening::Kind::stall:
      path.stalled_until_us = end_us;
      until_us += most_delay_us;
      break;
    default:
      until_us = now_us_ + most_delay_us;
      break;
  }
  path.disturbed_until_us = std::max(path.disturbed_until_us, until_us);
  const bool served = std::exchange(path.serves, false);
  path.fine = false;
  if (served && serves_since(now_us_ - std::min(now_us_, settled_us))) ++report_.failovers;
  if (kind != Happening::Kind::port_down) return;
  for (int w = 0; w < schedule_.paths(); ++w) {
    if (w != index && port_of(w) == port_of(index)) disturb(w, Happening::Kind::address, now_us_);
  }
  lose_port(port_of(index));
}

void World::unplug(const Happening& happening, bool over) {
  int index = 0;
  while (index + 1 < schedule_.paths() && (happening.paths >> index & 1U) == 0) ++index;
  Path& path = paths_[index];
  if (!over) {
    const std::uint64_t end_us = now_us_ + happening.length_us;
    path.unplugged_until_us = std::max(path.unplugged_until_us, end_us);
    disturb(index, happening.kind, path.unplugged_until_us);
    if (!schedule_.one_port) lose_port(port_of(index));
  } else if (now_us_ < path.unplugged_until_us) {
    return;
  }
  for (const auto& host : hosts_) {
    const Host::Place* const place = host->on(index);
    if (!host->alive || place == nullptr) continue;
    const auto at = static_cast<std::size_t>(place - host->places.data());
    host->session->on_transport(at, over, host->time());
    poll_host(host->index);
  }
}

// --- replayed datagrams

void World::record() {
  hosts_.push_back(std::make_unique<Host>(*this, 0));
  place(*hosts_.back());
  recording_ = true;
  start_host(0);
  at(random_.below(100'000), Event::Kind::command, 0);
  run_until(recorded_us);
  recording_ = false;
  hosts_.front()->die();
  events_ = {};
  packets_.clear();
  free_packets_.clear();
  now_us_ += hour_us;
  start_us_ = now_us_;
  if (schedule_.reboots_after_capture) {
    boot_board();
  } else {
    ++board_generation_;
    poll_board();
  }
  for (int times = 0; times < 2; ++times) {
    const std::uint64_t from_us = start_us_ + paths_random_.below(schedule_.duration_us);
    for (std::size_t i = 0; i < recorded_.size(); ++i) {
      at(from_us + recorded_[i].at_us, Event::Kind::replay, static_cast<int>(i));
    }
  }
}

void World::replay(int index) {
  const Recorded& recorded = recorded_[static_cast<std::size_t>(index)];
  const Host& host = *hosts_.front();
  const Host::Place& place = *host.on(schedule_.replaying_path);
  ++report_.replayed;
  const int slot = take_slot();
  Packet& packet = packets_[static_cast<std::size_t>(slot)];
  packet = Packet();
  packet.to_board = recorded.to_board;
  packet.place = static_cast<int>(&place - host.places.data());
  packet.port = port_of(place.path);
  packet.peer = place.peer;
  packet.recorded = true;
  packet.bytes = recorded.bytes;
  note(fmt::format("replay to {}", recorded.to_board ? "board" : "host"));
  deliver(slot);
}

// --- the promises

void World::on_path(std::uint32_t, Source path, bool joined) {
  note(fmt::format("path {} {}/{}", joined ? "joins" : "leaves", path.port, path.peer));
  if (!joined) {
    ++report_.path_losses;
    if (board_->paths().size() == 0) return;
    // A datagram of this peer has fed, although the peer has left the session's paths.
    std::uint64_t& heard_us = heard_us_[board_->paths()[0].peer];
    heard_us = std::max(heard_us, heard_us_[path.peer]);
    return;
  }
  ++report_.joins;
  if (!fed_.empty() && fed_.back().from.host < 0)
    return;  // a stranger's session may have any paths
  const bool of_host = !fed_.empty() && delivering_ == fed_.back().from;
  if (!of_host) violate(fmt::format("joined: peer {} is not of the session's host", path.peer));
}

bool World::meets_limits(int index) const {
  return is_fine(schedule_.faults(index, true)) && is_fine(schedule_.faults(index, false)) &&
         now_us_ >= paths_[index].disturbed_until_us && index != schedule_.replaying_path;
}

bool World::serves_since(std::uint64_t at_us) const {
  return std::any_of(std::begin(paths_), std::end(paths_), [at_us](const Path& path) {
    return path.serves && path.serves_since_us <= at_us;
  });
}

// True if a good path was in use when the command was requested, and before, for so long that
// earlier BUSY have expired and F was confirmed. Then the command arrives on this path. The state
// that confirms the command, or the answer to a duplicate, also arrives on this path.
bool World::should_be_confirmed(const Sent& sent) const {
  const std::uint64_t there_and_back_us =
      2 * most_delay_us + schedule_.settings.state_period_ms() * 1000U;
  const std::uint64_t known_us = busy_memory_us + there_and_back_us;
  return serves_since(sent.asked_us - std::min(sent.asked_us, known_us)) &&
         schedule_.command_timeout_us >= 150'000 + there_and_back_us;
}

void World::check_paths() {
  const Host& host = *hosts_.front();
  const bool in_control = !standing_ && host.alive && !host.frozen && !host.leaving &&
                          host.farewell_ticket == 0 && controls({0, host.incarnation});
  if (serves_since(now_us_)) report_.served_us += now_us_ - looked_us_;
  looked_us_ = now_us_;
  // True if no path has been in use for so long that this path had time to join.
  const bool alone = !serves_since(now_us_ - std::min(now_us_, used_again_us));
  const bool crowded = schedule_.attack_interval_us != 0;
  for (int w = 0; w < schedule_.paths(); ++w) {
    Path& path = paths_[w];
    if (!in_control || !meets_limits(w)) {
      path.fine = path.serves = false;
      continue;
    }
    if (!path.fine) path.fine_since_us = now_us_;
    path.fine = true;
    const auto at = static_cast<std::size_t>(w);
    const bool serves = board_->paths().has({port_of(w), host.places[at].peer}) &&
                        host.session->path(at, host.time()).state == PathState::carrying;
    const bool settled = path.serves && now_us_ - path.serves_since_us >= settled_us;
    if (settled && !serves) violate(fmt::format("paths: path {} is good and given up", w));
    if (serves && !path.serves) path.serves_since_us = now_us_;
    path.serves = serves;
    if (settled && serves) check_age(w);
    const std::uint64_t quiet_since_us = std::max(path.serves_since_us, path.told_busy_us);
    const bool known = path.serves && now_us_ - quiet_since_us > busy_memory_us + most_delay_us;
    if (known && host.session->link().causes.has(LinkCause::busy))
      violate("paths: BUSY is told beside a good path");
    if (!serves && !alone && !crowded && now_us_ - path.fine_since_us >= used_again_us) {
      violate(fmt::format("paths: path {} is good and not used", w));
    }
  }
}

void World::on_told_state(int index, std::string_view bytes) {
  Datagram datagram;
  if (!read_datagram(Text(bytes), datagram) || kind_of(datagram) != MessageKind::state) return;
  Path& path = paths_[index];
  const auto t_ms = static_cast<std::uint32_t>(datagram.time_ms());
  if (!path.brought_state || newer(t_ms, path.newest_t)) path.newest_t = t_ms;
  path.brought_state = true;
}

void World::check_age(int index) {
  const Path& path = paths_[index];
  const ReceivedState& state = hosts_.front()->session->state();
  if (!state.any()) return violate("paths: no state beside a good path");
  if (path.brought_state && newer(path.newest_t, state.t_ms)) {
    return violate(fmt::format("paths: the newest state is {} ms older than what path {} brought",
                               path.newest_t - state.t_ms, index));
  }
  const ChannelFaults& faults = schedule_.faults(index, false);
  const std::uint32_t limit_us = 2 * schedule_.settings.state_period_ms() * 1000U +
                                 faults.delay_us + faults.jitter_us + schedule_.board_lateness_us +
                                 5'000;
  const std::uint32_t age_ms = board_ms() - state.t_ms;
  if (age_ms > limit_us / 1000) {
    violate(fmt::format("paths: the newest state is {} ms old beside good path {}", age_ms, index));
  }
}

}  // namespace r4::simulation
