// SPDX-License-Identifier: GPL-3.0-or-later
#include "session_wires.hpp"

namespace r4 {

int SessionWires::find(Source at) const {
  int i = count_;
  while (i-- > 0 && wires_[i].at != at) {
  }
  return i;
}

void SessionWires::begin(Source at, Heartbeat heartbeat, std::uint32_t now_ms) {
  count_ = 1;
  wires_[0].at = at;
  wires_[0].heard_ms = now_ms;
  known_[0].heartbeat = heartbeat;
  known_[0].at_ms = now_ms;
  known_used_ = known_next_ = 1;
  for (auto& port : candidates_) {
    for (Candidate& candidate : port) candidate.waits = false;
  }
  change_count_ = 0;
  numbers_.restart();
}

void SessionWires::resume(std::uint32_t now_ms) {
  for (int i = 0; i < count_; ++i) wires_[i].heard_ms = now_ms;
}

void SessionWires::taken(Source at, Heartbeat heartbeat, std::uint32_t timeout_ms,
                         std::uint32_t now_ms) {
  const int wire = find(at);
  if (wire >= 0) wires_[wire].heard_ms = now_ms;
  known_[known_next_].heartbeat = heartbeat;
  known_[known_next_].at_ms = now_ms;
  known_next_ = (known_next_ + 1) % remembered;
  if (known_used_ < remembered) ++known_used_;
  for (auto& port : candidates_) {
    for (Candidate& candidate : port) {
      if (!candidate.waits || !(candidate.heartbeat == heartbeat)) continue;
      candidate.waits = false;
      if (now_ms - candidate.at_ms < timeout_ms) join(candidate.from, now_ms);
    }
  }
}

void SessionWires::passed_over(Source at, Heartbeat heartbeat, std::uint32_t timeout_ms,
                               std::uint32_t now_ms) {
  const int wire = find(at);
  if (wire >= 0 && is_known(heartbeat, timeout_ms, now_ms)) wires_[wire].heard_ms = now_ms;
}

bool SessionWires::is_known(Heartbeat heartbeat, std::uint32_t timeout_ms,
                            std::uint32_t now_ms) const {
  for (int i = 0; i < known_used_; ++i) {
    if (known_[i].heartbeat == heartbeat && now_ms - known_[i].at_ms < timeout_ms) return true;
  }
  return false;
}

SessionWires::Stranger SessionWires::on_stranger(Source from, Heartbeat heartbeat,
                                                 std::uint32_t newest, std::uint32_t timeout_ms,
                                                 std::uint32_t now_ms) {
  if (count_ == most) return Stranger::unknown;
  if (is_known(heartbeat, timeout_ms, now_ms)) {
    join(from, now_ms);
    return Stranger::joined;
  }
  const auto ahead = [newest](std::uint32_t pnum) {
    return newer(pnum, newest) && pnum - newest <= most_ahead;
  };
  if (!ahead(heartbeat.pnum)) return Stranger::unknown;
  // A place that is ahead of the session's wires brings the next heartbeats before the first has come by
  // those: that one stays until the session is past it.
  Candidate* place = nullptr;
  for (Candidate& candidate : candidates_[from.port % ports]) {
    if (candidate.waits &&
        (!ahead(candidate.heartbeat.pnum) || now_ms - candidate.at_ms >= timeout_ms)) {
      candidate.waits = false;
    }
    if (candidate.waits && candidate.from == from) return Stranger::waits;
    const bool better = place == nullptr || (place->waits && !candidate.waits) ||
                        (place->waits == candidate.waits && newer(place->at_ms, candidate.at_ms));
    if (better) place = &candidate;
  }
  place->from = from;
  place->heartbeat = heartbeat;
  place->at_ms = now_ms;
  place->waits = true;
  return Stranger::waits;
}

void SessionWires::poll(std::uint32_t timeout_ms, std::uint32_t now_ms) {
  for (int i = count_; i-- > 0 && count_ > 1;) {
    if (now_ms - wires_[i].heard_ms >= timeout_ms) leave(i);
  }
}

bool SessionWires::port_lost(std::uint8_t port) {
  int there = 0;
  for (int i = 0; i < count_; ++i) there += wires_[i].at.port == port ? 1 : 0;
  if (there == 0 || there == count_) return false;
  for (int i = count_; i-- > 0;) {
    if (wires_[i].at.port == port) leave(i);
  }
  return true;
}

// Two wires at least: until then what one repeats is what the count over all of them says.
bool SessionWires::count(Source from, std::uint32_t pnum) {
  const int wire = find(from);
  if (count_ == 1 || wire < 0) {
    if (numbers_.on(pnum) == Arrival::duplicate) ++repeated_;
    return false;
  }
  const bool repeated = wires_[wire].numbers.on(pnum) == Arrival::duplicate;
  if (repeated) ++repeated_;
  // What a wire that lags brings so late is no sign that the host has begun again.
  const std::uint32_t newest = numbers_.newest();
  const bool long_past =
      numbers_.started() && !newer(pnum, newest) && newest - pnum >= PacketTracker::window;
  const bool known = long_past || numbers_.on(pnum) == Arrival::duplicate;
  return known && !repeated;
}

bool SessionWires::take_change(Change& change) {
  if (change_count_ == 0) return false;
  change = changes_[0];
  --change_count_;
  for (int i = 0; i < change_count_; ++i) changes_[i] = changes_[i + 1];
  return true;
}

void SessionWires::join(Source at, std::uint32_t now_ms) {
  if (count_ == most || has(at)) return;
  if (count_ == 1) wires_[0].numbers = PacketTracker();
  Wire& wire = wires_[count_++];
  wire.at = at;
  wire.heard_ms = now_ms;
  wire.numbers = PacketTracker();
  for (Candidate& candidate : candidates_[at.port % ports]) {
    if (candidate.from == at) candidate.waits = false;
  }
  ++joins_;
  changed(at, true);
}

void SessionWires::leave(int index) {
  const Source at = wires_[index].at;
  --count_;
  for (int i = index; i < count_; ++i) wires_[i] = wires_[i + 1];
  ++losses_;
  changed(at, false);
}

void SessionWires::changed(Source at, bool joined) {
  if (change_count_ == most) return;
  changes_[change_count_].at = at;
  changes_[change_count_].joined = joined;
  ++change_count_;
}

}  // namespace r4
