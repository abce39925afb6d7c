// SPDX-License-Identifier: GPL-3.0-or-later
#include "watchers.hpp"

namespace r4 {

Watchers::Effect Watchers::on_lease(Source from, std::uint32_t rate_hz, std::uint64_t echo,
                                    bool proven, std::uint32_t now_ms) {
  poll(now_ms);  // a lease that has expired cannot be renewed
  Watcher* place = find(from);
  const bool renews = proven || (place != nullptr && place->token == echo);
  if (!renews && !is_told(from, echo, now_ms)) {
    if (rate_hz == 0) return Effect::ignored;
    const std::uint32_t newest_ms = told_[(tokens_ - 1) % told_count].at_ms;
    const bool just_now = tokens_ != 0 && now_ms - newest_ms < answer_spacing_ms;
    return just_now ? Effect::ignored : Effect::unproven;
  }
  if (rate_hz == 0) {
    if (place == nullptr) return Effect::ignored;
    *place = Watcher();
    return Effect::ended;
  }
  if (place == nullptr) {
    for (Watcher& each : watchers_) {
      if (place == nullptr && each.period_ms == 0) place = &each;
    }
    if (place == nullptr) return Effect::full;
    place->at = from;
    place->next_ms = now_ms;
  }
  place->token = static_cast<std::uint32_t>(echo);
  place->period_ms = 1000U / rate_hz;
  place->renewed_ms = now_ms;
  return Effect::watching;
}

void Watchers::tell(Source to, std::uint32_t token, std::uint32_t now_ms) {
  Told& told = told_[tokens_++ % told_count];
  told.at = to;
  told.token = token;
  told.at_ms = now_ms;
}

bool Watchers::is_told(Source from, std::uint64_t echo, std::uint32_t now_ms) const {
  const std::uint32_t count = tokens_ < told_count ? tokens_ : told_count;
  for (std::uint32_t i = 0; i < count; ++i) {
    const Told& told = told_[i];
    if (told.at == from && told.token == echo && now_ms - told.at_ms <= lease_ms) return true;
  }
  return false;
}

void Watchers::poll(std::uint32_t now_ms) {
  for (Watcher& each : watchers_) {
    if (each.period_ms != 0 && now_ms - each.renewed_ms >= lease_ms) each = Watcher();
  }
}

void Watchers::end_of(Source at) {
  if (Watcher* const watcher = find(at)) *watcher = Watcher();
}

Watcher* Watchers::find(Source at) {
  for (Watcher& each : watchers_) {
    if (each.period_ms != 0 && each.at == at) return &each;
  }
  return nullptr;
}

bool Watchers::any() const {
  for (const Watcher& each : watchers_) {
    if (each.period_ms != 0) return true;
  }
  return false;
}

}  // namespace r4
