// SPDX-License-Identifier: GPL-3.0-or-later
#include "path_news.hpp"

#include <algorithm>

namespace r4 {

void PathNews::on_number(std::size_t index, std::uint32_t pnum) {
  Numbers& path = paths_[index];
  const std::uint32_t lost = path.tracker.counters().lost;
  path.pnum = pnum;
  path.arrival = path.tracker.on(pnum);
  path.gap = path.arrival == Arrival::gap ? path.tracker.counters().lost - lost : 0;
}

void PathNews::on_answer(std::size_t index, std::uint32_t pnum) {
  Numbers& path = paths_[index];
  if (!path.tracker.started()) return;
  on_number(index, pnum);
  if (path.arrival == Arrival::duplicate || path.arrival == Arrival::late) return count_copy(path);
  ++counters_.received;
  count_gap(path);
  path.others -= std::min(path.others, path.gap);
}

void PathNews::restart(std::size_t index) {
  PacketTracker& tracker = paths_[index].tracker;
  if (tracker.started()) tracker.restart();
}

bool PathNews::is_new(std::optional<First>& newest, std::size_t path, std::uint32_t t_ms) const {
  const std::uint32_t pnum = paths_[path].pnum;
  const bool fresh = !newest || newer(t_ms, newest->t_ms) ||
                     (t_ms == newest->t_ms && path == newest->path && newer(pnum, newest->pnum));
  if (fresh) newest = {t_ms, pnum, path};
  return fresh;
}

bool PathNews::take_heartbeat(std::size_t path, std::uint32_t t_ms) {
  const bool fresh = is_new(newest_.heartbeat, path, t_ms);
  fresh ? count_new(paths_[path]) : count_copy(paths_[path]);
  return fresh;
}

bool PathNews::is_newest_state(std::size_t path, std::uint32_t t_ms) {
  if (!newest_.state || !newer(newest_.state->t_ms, t_ms)) return true;
  count_copy(paths_[path]);
  return false;
}

bool PathNews::take_state(std::size_t path, std::uint32_t t_ms, FieldSet present) {
  if (!newest_.state || t_ms != newest_.state->t_ms) newest_.fields = FieldSet();
  const FieldSet known = newest_.fields;
  newest_.fields.add(present);
  bool fresh = is_new(newest_.state, path, t_ms);
  if (!fresh && !(newest_.fields == known)) {
    fresh = true;
    newest_.state = {t_ms, paths_[path].pnum, path};
  }
  fresh ? count_new(paths_[path]) : count_copy(paths_[path]);
  return fresh;
}

// A heartbeat may overtake queued states, also a state of the same millisecond.
bool PathNews::is_newest(std::size_t path, std::uint32_t t_ms) {
  const std::optional<First>& known = newest_.any;
  const std::uint32_t pnum = paths_[path].pnum;
  if (known && newer(known->t_ms, t_ms)) return false;
  const bool same = known && known->t_ms == t_ms && known->path == path;
  if (same && newer(known->pnum, pnum)) return false;
  newest_.any = {t_ms, pnum, path};
  return true;
}

// The board answers a duplicate of a command with the first answer, or with DUPLICATE.
bool PathNews::is_copy(const Nack& nack) {
  if (nack.code == Refusal::duplicate) return true;
  const std::pair answer(nack.pnum, nack.code);
  if (std::find(told_.begin(), told_.end(), answer) != told_.end()) return true;
  told_[answers_++ % told_.size()] = answer;
  return false;
}

void PathNews::count_new(Numbers& path) {
  ++counters_.received;
  if (!take_back(path)) count_gap(path);
  for (Numbers& each : paths_) ++each.others;
  path.others = 0;
}

void PathNews::count_copy(Numbers& path) {
  if (take_back(path)) {
    ++counters_.received;
    return;
  }
  ++path.copies;
  ++counters_.duplicate;
  path.others -= std::min(path.others, path.gap + 1);
}

void PathNews::count_gap(Numbers& path) {
  if (path.gap <= path.others) return;
  path.lost += path.gap - path.others;
  counters_.lost += path.gap - path.others;
}

bool PathNews::take_back(Numbers& path) {
  if (path.arrival != Arrival::late || path.lost == 0) return false;
  --path.lost;
  --counters_.lost;
  ++counters_.late;
  return true;
}

}  // namespace r4
