// SPDX-License-Identifier: GPL-3.0-or-later
// The run of a simulation: events in the order of their times, and the trace of all events.
#include "world.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "script.hpp"
#include "world_host.hpp"

namespace r4::simulation {

namespace {

constexpr std::int64_t million = 1'000'000;

}  // namespace

World::World(std::uint64_t seed, bool keep_trace, Beside beside)
    : World(seed, Schedule(), keep_trace) {
  schedule_ = Schedule::random(random_);
  // A separate generator, so that the other events of a schedule are the same with and without
  // watchers.
  Random watch_random(seed + 0x5eed);
  if (watch_random.chance(0.3)) schedule_.add_watchers(watch_random);
  if (beside == Beside::standstills) schedule_.add_standstills(loop_random_);
  if (beside == Beside::paths) {
    schedule_.add_paths(paths_random_);
    if (paths_random_.chance(0.15)) schedule_.add_standstills(loop_random_);
  }
  Random drift_random(seed + 0xd21f7);
  schedule_.add_drift(drift_random);
  schedule_.add_stranger(stranger_random_);
}

World::World(std::uint64_t seed, Schedule schedule, bool keep_trace)
    : random_(seed),
      loop_random_(~seed),
      schedule_(std::move(schedule)),
      keep_trace_(keep_trace),
      stranger_random_(seed + 0x57a96e),
      paths_random_(seed + 0x311e5) {
  report_.seed = seed;
}

World::World(Schedule schedule, Script& script, bool keep_trace)
    : World(1, std::move(schedule), keep_trace) {
  script_ = &script;
}

World::~World() = default;

Report World::run() {
  report_.trace_hash = 0xcbf29ce484222325U;
  commands_.emplace_back();  // 0 is the position at the start, so no command has this name
  boot_board();
  if (schedule_.replaying_path >= 0) record();
  for (int i = 0; i < schedule_.hosts; ++i) {
    if (hosts_.size() == static_cast<std::size_t>(i)) {
      hosts_.push_back(std::make_unique<Host>(*this, i));
      place(*hosts_.back());
    }
    if (script_ != nullptr) continue;
    start_host(i);
    at(start_us_ + random_.below(300'000), Event::Kind::command, i);
  }
  hosts_.push_back(std::make_unique<Host>(*this, schedule_.hosts));
  hosts_.back()->stopper = true;
  place(*hosts_.back());
  add_watchers();
  for (std::size_t i = 0; i < schedule_.happenings.size(); ++i) {
    at(start_us_ + schedule_.happenings[i].at_us, Event::Kind::happening, static_cast<int>(i));
  }
  if (schedule_.attack_interval_us != 0) at(start_us_, Event::Kind::attack, 0);
  for (std::size_t i = 0; i < schedule_.standstills.size(); ++i) {
    at(start_us_ + schedule_.standstills[i].at_us, Event::Kind::standstill, static_cast<int>(i));
  }
  if (schedule_.stranger_interval_us != 0) at(start_us_ + 1, Event::Kind::stranger, 0);
  if (script_ != nullptr) script_->begin();
  run_until(start_us_ + schedule_.duration_us);
  if (script_ != nullptr && report_.violation.empty()) script_->end();
  for (const auto& host : hosts_) {
    if (host->alive) host->count_copies();
  }
  over_ = true;
  return std::move(report_);
}

void World::run_until(std::uint64_t end_us) {
  while (!events_.empty() && report_.violation.empty()) {
    const Event event = events_.top();
    if (event.at_us > end_us) break;
    events_.pop();
    now_us_ = event.at_us;
    ++handled_;
    handle(event);
    check_lost();
    check_silence();
    if (script_ != nullptr) script_->check();
    if (several() && !recording_ && hosts_.front()->places.size() > 1) check_paths();
  }
}

void World::handle(const Event& event) {
  switch (event.kind) {
    case Event::Kind::packet:
      deliver(event.index);
      break;
    case Event::Kind::board:
      if (event.generation == board_generation_ && !standing_) poll_board();
      break;
    case Event::Kind::standstill:
      stand_still(schedule_.standstills[static_cast<std::size_t>(event.index)]);
      break;
    case Event::Kind::go_on:
      if (event.generation == board_generation_) go_on();
      break;
    case Event::Kind::host:
      if (event.generation == hosts_[static_cast<std::size_t>(event.index)]->poll_generation) {
        poll_host(event.index);
      }
      break;
    case Event::Kind::command:
      issue_command(event.index);
      break;
    case Event::Kind::happening:
      happen(schedule_.happenings[static_cast<std::size_t>(event.index)], false);
      break;
    case Event::Kind::attack:
      attack();
      break;
    case Event::Kind::forge:
      forge_lease();
      break;
    case Event::Kind::over:
      happen(schedule_.happenings[static_cast<std::size_t>(event.index)], true);
      break;
    case Event::Kind::stranger:
      stranger();
      break;
    case Event::Kind::replay:
      replay(event.index);
      break;
    case Event::Kind::script:
      script_->on_event(event.index);
      break;
  }
}

void World::at(std::uint64_t time_us, Event::Kind kind, int index, std::uint32_t generation) {
  events_.push(Event{time_us, order_++, kind, index, generation});
}

std::uint32_t World::board_ms() const {
  const std::uint64_t board_us = (now_us_ - boot_us_) *
                                 static_cast<std::uint64_t>(million + schedule_.board_drift_ppm) /
                                 million;
  return boot_offset_ms_ + static_cast<std::uint32_t>(board_us / 1000);
}

std::uint64_t World::when_board_shows(std::uint32_t t_ms) const {
  const auto board_us = std::uint64_t{t_ms - boot_offset_ms_} * 1000;
  const auto rate = static_cast<std::uint64_t>(million + schedule_.board_drift_ppm);
  return boot_us_ + (board_us * million + rate - 1) / rate;
}

void World::mix(const void* data, std::size_t size) {
  const auto* bytes = static_cast<const char*>(data);
  auto add = [this](std::uint64_t word) {
    report_.trace_hash = (report_.trace_hash ^ word) * 0x100000001b3U;
    report_.trace_hash ^= report_.trace_hash >> 32;
  };
  add(now_us_);
  add(size);
  for (std::size_t i = 0; i < size; i += sizeof(std::uint64_t)) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes + i, std::min(size - i, sizeof word));
    add(word);
  }
}

void World::note(const std::string& line) {
  mix(line.data(), line.size());
  if (keep_trace_) show(line);
}

void World::show(const std::string& line) {
  report_.trace.push_back(fmt::format("{:>9} us  {}", now_us_, line));
}

void World::violate(const std::string& what) {
  note("VIOLATION " + what);
  if (report_.violation.empty()) report_.violation = what;
}

}  // namespace r4::simulation
