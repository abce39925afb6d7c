// SPDX-License-Identifier: GPL-3.0-or-later
#include "schedule.hpp"

namespace r4::simulation {

namespace {

ChannelFaults random_faults(Random& random) {
  ChannelFaults faults;
  static constexpr double losses[] = {0, 0, 0.01, 0.1, 0.3};
  static constexpr double shares[] = {0, 0, 0.02, 0.2};
  static constexpr std::uint32_t jitters_us[] = {0, 0, 2'000, 20'000, 150'000};
  static constexpr std::uint32_t delays_us[] = {100, 1'000, 10'000, 100'000};
  faults.loss = random.pick(losses);
  faults.duplicate = random.pick(shares);
  faults.corrupt = random.pick(shares) / 2;
  faults.delay_us = random.pick(delays_us);
  faults.jitter_us = random.pick(jitters_us);
  if (random.chance(0.4)) {
    faults.straggle = 0.05;
    faults.straggle_us = static_cast<std::uint32_t>(random.between(200'000, 4'000'000));
  }
  return faults;
}

}  // namespace

Schedule Schedule::random(Random& random) {
  Schedule s;
  s.duration_us = random.between(2'500'000, 6'000'000);
  s.hosts = random.chance(0.25) ? 2 : 1;
  static constexpr std::uint16_t rates[] = {5, 10, 10, 20, 20, 50, 100};
  s.settings.state_rate_hz = random.pick(rates);
  s.settings.recovery = random.chance(0.7) ? Recovery::last : Recovery::rearm;
  s.to_board = random_faults(random);
  s.to_host = random_faults(random);
  s.command_interval_us = static_cast<std::uint32_t>(random.between(5'000, 400'000));
  s.command_timeout_us = static_cast<std::uint32_t>(random.between(100'000, 2'500'000));
  s.post_share = random.chance(0.5) ? 0.5 : 0;
  s.group_share = random.chance(0.5) ? 0.5 : 0;
  s.board_lateness_us = static_cast<std::uint32_t>(random.below(3'000));
  const int count = static_cast<int>(random.below(6));
  for (int i = 0; i < count; ++i) {
    Happening h;
    h.kind = static_cast<Happening::Kind>(random.below(12));
    h.at_us = random.below(s.duration_us);
    h.length_us = random.between(1'000, 2'500'000);
    h.host = static_cast<int>(random.below(static_cast<std::uint64_t>(s.hosts)));
    s.happenings.push_back(h);
  }
  s.shared_place = random.chance(0.3);
  // Stops that cross an E:CLEAR of an earlier stop.
  if (random.chance(0.3)) {
    Happening stop;
    stop.kind = random.chance(0.5) ? Happening::Kind::stop : Happening::Kind::stopper;
    stop.at_us = random.below(s.duration_us);
    stop.length_us = random.between(1'000, 1'000'000);
    stop.host = static_cast<int>(random.below(static_cast<std::uint64_t>(s.hosts)));
    s.happenings.push_back(stop);
    Happening clear = stop;
    clear.kind = Happening::Kind::stop;
    s.happenings.push_back(clear);
    for (std::uint64_t n = random.between(1, 2); n != 0; --n) {
      Happening crossing = stop;
      crossing.kind = Happening::Kind::stopper;
      crossing.at_us += stop.length_us + random.below(300'000);
      s.happenings.push_back(crossing);
    }
  }
  if (random.chance(0.3)) {
    s.attack_interval_us = static_cast<std::uint32_t>(random.between(2'000, 200'000));
  }
  // A host that ends and restarts, perhaps before its farewell has arrived.
  for (std::uint64_t n = random.chance(0.3) ? random.between(1, 3) : 0; n != 0; --n) {
    Happening leave;
    leave.kind = Happening::Kind::leave;
    leave.at_us = random.below(s.duration_us);
    leave.length_us = random.chance(0.5) ? random.between(1'000, 150'000) : random.below(1'500'000);
    leave.host = static_cast<int>(random.below(static_cast<std::uint64_t>(s.hosts)));
    s.happenings.push_back(leave);
  }
  return s;
}

// Watchers begin and end. Sometimes the board has too few places for the watchers.
void Schedule::add_watchers(Random& random) {
  watchers = static_cast<int>(random.between(1, 6));
  for (int i = 0; i < watchers; ++i) {
    for (std::uint64_t n = random.between(1, 2); n != 0; --n) {
      Happening watch;
      watch.kind = Happening::Kind::watch;
      watch.at_us = random.below(duration_us);
      watch.length_us = random.between(1'000, 3'000'000);
      watch.host = i;
      happenings.push_back(watch);
      if (!random.chance(0.05)) continue;
      watch.kind = Happening::Kind::watcher_stops;
      watch.at_us += random.below(watch.length_us);
      happenings.push_back(watch);
    }
  }
  if (random.chance(0.7)) {
    forge_interval_us = static_cast<std::uint32_t>(random.between(2'000, 100'000));
  }
}

void Schedule::add_standstills(Random& random) {
  static constexpr std::uint64_t longest_us[] = {20'000, 50'000, 300'000, 800'000};
  static constexpr std::uint64_t most_apart_us[] = {60'000, 1'000'000, 3'000'000};
  const std::uint64_t apart_us = random.pick(most_apart_us);
  for (std::uint64_t at_us = random.below(apart_us); at_us < duration_us;) {
    const std::uint64_t length_us = random.between(5'000, random.pick(longest_us));
    standstills.push_back({at_us, length_us});
    at_us += length_us + random.between(1, apart_us);
  }
}

void Schedule::add_drift(Random& random) {
  board_drift_ppm =
      static_cast<std::int64_t>(random.below(2 * most_drift_ppm + 1)) - most_drift_ppm;
}

const ChannelFaults& Schedule::faults(int path, bool toward_board) const {
  if (path == 0) return toward_board ? to_board : to_host;
  const PathFaults& faults = more_paths[static_cast<std::size_t>(path) - 1];
  return toward_board ? faults.to_board : faults.to_host;
}

// In most schedules one path is good except for its happenings. A happening affects one path or
// several paths at once.
void Schedule::add_paths(Random& random) {
  for (std::uint64_t n = random.between(1, 2); n != 0; --n) {
    more_paths.push_back({random_faults(random), random_faults(random)});
  }
  const auto count = static_cast<std::uint64_t>(paths());
  for (std::uint64_t n = random.chance(0.8) ? random.between(1, count) : 0; n != 0; --n) {
    const std::uint64_t good = random.below(count);
    for (ChannelFaults* const faults : {good == 0 ? &to_board : &more_paths[good - 1].to_board,
                                        good == 0 ? &to_host : &more_paths[good - 1].to_host}) {
      static constexpr std::uint32_t delays_us[] = {100, 1'000, 10'000, 50'000};
      static constexpr std::uint32_t jitters_us[] = {0, 2'000, 20'000};
      static constexpr double shares[] = {0, 0.2};
      *faults = ChannelFaults();
      faults->delay_us = random.pick(delays_us);
      faults->jitter_us = random.pick(jitters_us);
      faults->duplicate = random.pick(shares);
    }
  }
  one_port = random.chance(0.4);
  const auto some_paths = [&] {
    if (random.chance(0.2)) return static_cast<std::uint8_t>(random.between(1, 7));
    return static_cast<std::uint8_t>(1U << random.below(count));
  };
  for (Happening& happening : happenings) happening.paths = some_paths();
  static constexpr Happening::Kind kinds[] = {
      Happening::Kind::cut,    Happening::Kind::cut,   Happening::Kind::cut_to_board,
      Happening::Kind::unplug, Happening::Kind::stall, Happening::Kind::cut_to_host};
  for (std::uint64_t n = random.below(5); n != 0; --n) {
    Happening happening;
    happening.kind = random.pick(kinds);
    happening.at_us = random.below(duration_us);
    happening.length_us = random.between(1'000, 2'500'000);
    happening.host = 0;
    happening.paths = some_paths();
    happenings.push_back(happening);
  }
  attacked_path = static_cast<int>(random.below(count));
  if (random.chance(0.2)) replaying_path = static_cast<int>(random.below(count));
  reboots_after_capture = random.chance(0.3);
}

void Schedule::add_stranger(Random& random) {
  static constexpr double claims[] = {0, 0, 0.05, 0.3};
  stranger_interval_us = static_cast<std::uint32_t>(random.between(10'000, 300'000));
  stranger_claims = random.pick(claims);
}

const char* to_text(Happening::Kind kind) {
  switch (kind) {
    case Happening::Kind::cut:
      return "cut";
    case Happening::Kind::cut_to_board:
      return "cut_to_board";
    case Happening::Kind::cut_to_host:
      return "cut_to_host";
    case Happening::Kind::host_restart:
      return "host_restart";
    case Happening::Kind::host_freeze:
      return "host_freeze";
    case Happening::Kind::board_restart:
      return "board_restart";
    case Happening::Kind::port_down:
      return "port_down";
    case Happening::Kind::stop:
      return "stop";
    case Happening::Kind::handle:
      return "handle";
    case Happening::Kind::obstacle:
      return "obstacle";
    case Happening::Kind::address:
      return "address";
    case Happening::Kind::stopper:
      return "stopper";
    case Happening::Kind::leave:
      return "leave";
    case Happening::Kind::watch:
      return "watch";
    case Happening::Kind::watcher_stops:
      return "watcher_stops";
    case Happening::Kind::unplug:
      return "unplug";
    case Happening::Kind::stall:
      return "stall";
  }
  return "?";
}

}  // namespace r4::simulation
