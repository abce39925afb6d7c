// SPDX-License-Identifier: GPL-3.0-or-later
#include "session_paths.hpp"

namespace r4 {

int SessionPaths::find(Source at) const {
  int i = count_;
  while (i-- > 0 && paths_[i].at != at) {
  }
  return i;
}

void SessionPaths::begin(Source at, std::uint32_t now_ms) {
  numbers_.restart();
  resume(at, now_ms);
}

void SessionPaths::resume(Source at, std::uint32_t now_ms) {
  count_ = 1;
  paths_[0].at = at;
  paths_[0].heard_ms = now_ms;
  paths_[0].seen = 0;
}

bool SessionPaths::on_heartbeat(Source from, std::uint32_t now_ms) {
  const int known = find(from);
  if (known < 0 && count_ == most) return false;
  Path& path = paths_[known < 0 ? count_ : known];
  path.heard_ms = now_ms;
  if (known >= 0) return false;
  path.at = from;
  path.seen = 0;
  ++count_;
  ++joins_;
  return true;
}

bool SessionPaths::take_silent(std::uint32_t timeout_ms, std::uint32_t now_ms, Source& left) {
  for (int i = 0; count_ > 1 && i < count_; ++i) {
    if (now_ms - paths_[i].heard_ms >= timeout_ms) return leave(i, left);
  }
  return false;
}

bool SessionPaths::take_port(std::uint8_t port, Source& left) {
  for (int i = 0; i < count_; ++i) {
    if (paths_[i].at.port == port) return leave(i, left);
  }
  return false;
}

// A number older than the window comes from a slow path: it does not mean that the host restarted.
bool SessionPaths::count(Source from, std::uint32_t pnum) {
  constexpr std::uint32_t window = PacketTracker::window;
  const std::uint32_t before = numbers_.newest();
  if (numbers_.started() && !newer(pnum, before) && before - pnum >= window) return true;
  const bool known = numbers_.on(pnum) == Arrival::duplicate;
  const std::uint32_t ahead = numbers_.newest() - before;
  for (int i = 0; ahead != 0 && i < count_; ++i) {
    paths_[i].seen = ahead < window ? paths_[i].seen << ahead : 0;
  }
  const std::uint32_t behind = numbers_.newest() - pnum;
  const int path = find(from);
  if (path < 0 || behind >= window) return known;
  const std::uint64_t bit = std::uint64_t{1} << behind;
  const bool repeated = (paths_[path].seen & bit) != 0;
  paths_[path].seen |= bit;
  if (repeated) ++repeated_;
  return known && !repeated;
}

bool SessionPaths::leave(int index, Source& left) {
  left = paths_[index].at;
  --count_;
  for (int i = index; i < count_; ++i) paths_[i] = paths_[i + 1];
  ++losses_;
  return true;
}

}  // namespace r4
