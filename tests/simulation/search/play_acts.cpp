// SPDX-License-Identifier: GPL-3.0-or-later
// The acts of a story, and all faults except the faults of datagrams.
#include <utility>

#include "play.hpp"
#include "tests/simulation/world_host.hpp"

namespace r4::simulation {
namespace {

constexpr std::uint64_t outage_us = 1'300'000;
constexpr std::uint64_t sleep_us = 1'500'000;
constexpr std::uint64_t short_us = 400'000;
constexpr std::uint64_t standstill_us = 1'200'000;
constexpr std::uint64_t restart_us = 50'000;
constexpr std::uint64_t stopper_us = 400'000;

}  // namespace

void Play::disturb_all(std::uint64_t until_us) {
  for (int w = 0; w < story_.paths; ++w) {
    world_.disturb(w, Happening::Kind::address, world_.now_us_);
    std::uint64_t& disturbed = world_.paths_[w].disturbed_until_us;
    disturbed = std::max(disturbed, until_us + disturbed_us);
  }
}

void Play::act(const Act& act) {
  const int whose = act.whose;
  switch (act.kind) {
    case Act::Kind::start:
      if (!host(whose).alive) world_.start_host(whose);
      break;
    case Act::Kind::command:
    case Act::Kind::group:
      when_it_runs(whose, [this, act] { command(act.whose, act.kind == Act::Kind::group); });
      break;
    case Act::Kind::stop:
      when_it_runs(whose, [this, whose] { world_.stop(host(whose)); });
      break;
    case Act::Kind::clear:
      when_it_runs(whose, [this, whose] { world_.clear_stop(host(whose)); });
      break;
    case Act::Kind::leave:
      when_it_runs(whose, [this, whose] {
        if (host(whose).farewell_ticket == 0) world_.leave(host(whose));
      });
      break;
    case Act::Kind::kill:
      kill(whose);
      break;
    case Act::Kind::reboot:
      begin_fault(Fault::Kind::reboots, 0, 0, {});
      break;
    case Act::Kind::sleep:
      sleep(whose);
      break;
    case Act::Kind::cut:
      begin_fault(Fault::Kind::cut, 0, whose, {});
      break;
  }
}

void Play::begin_fault(Fault::Kind kind, int index, int path, const std::string& bytes) {
  const std::uint64_t until_us = world_.now_us_ + outage_us;
  const std::uint32_t own = Stranger::address;
  switch (kind) {
    case Fault::Kind::cut:
      return world_.disturb(path, Happening::Kind::cut, until_us);
    case Fault::Kind::cut_to_board:
      return world_.disturb(path, Happening::Kind::cut_to_board, until_us);
    case Fault::Kind::cut_to_host:
      return world_.disturb(path, Happening::Kind::cut_to_host, until_us);
    case Fault::Kind::cut_shortly:
      return world_.disturb(path, Happening::Kind::cut, world_.now_us_ + short_us);
    case Fault::Kind::held:
      return world_.disturb(path, Happening::Kind::stall, until_us);
    case Fault::Kind::unplugged: {
      may_be_lost_ = true;
      const Happening happening{Happening::Kind::unplug, 0, outage_us, index,
                                static_cast<std::uint8_t>(1U << path)};
      world_.unplug(happening, false);
      return after(outage_us, [this, happening] { world_.unplug(happening, true); });
    }
    case Fault::Kind::port_lost:
      may_be_lost_ = true;
      return world_.disturb(path, Happening::Kind::port_down, world_.now_us_);
    case Fault::Kind::restarts:
    case Fault::Kind::dies:
      if (!host(index).alive) return;
      kill(index);
      return start_after(index, kind == Fault::Kind::dies ? outage_us : restart_us);
    case Fault::Kind::sleeps:
      return sleep(index);
    case Fault::Kind::pauses:
      return pause(index);
    case Fault::Kind::moves:
      for (Host::Place& place : host(index).places) {
        if (place.path != path) continue;
        world_.disturb(path, Happening::Kind::address, world_.now_us_);
        std::swap(place.peer, place.other_peer);
        if (place.peer == 0) place.peer = world_.next_peer_++;
      }
      return;
    case Fault::Kind::stops:
      return when_it_runs(index, [this, index] { world_.stop(host(index)); });
    case Fault::Kind::clears:
      return when_it_runs(index, [this, index] { world_.clear_stop(host(index)); });
    case Fault::Kind::reboots:
      disturb_all(world_.now_us_);
      has_controller_ = executed_ = false;
      return world_.boot_board();
    case Fault::Kind::stands_still:
      if (world_.standing_) return;
      disturb_all(world_.now_us_ + standstill_us);
      world_.schedule_.standstills.push_back({world_.now_us_, standstill_us});
      return world_.stand_still(world_.schedule_.standstills.back());
    case Fault::Kind::bridge_restarts:
      return begin_bridge();
    case Fault::Kind::other_stops:
      world_.call_stopper(host(story_.hosts), false);
      return after(stopper_us, [this] { world_.call_stopper(host(story_.hosts), true); });
    case Fault::Kind::stranger_beats:
    case Fault::Kind::stranger_drives:
    case Fault::Kind::stranger_leaves:
    case Fault::Kind::stranger_clears:
      return say_once(kind);
    case Fault::Kind::stranger_joins:
    case Fault::Kind::stranger_is_paper:
    case Fault::Kind::stranger_competes:
      return carry_on(kind, world_.port_of(story_.paths - 1), own);
    case Fault::Kind::stranger_elsewhere:
      return carry_on(kind, world_.port_of(0), own);
    case Fault::Kind::stranger_inherits:
      return carry_on(kind, world_.port_of(host(0).places.front().path), first_peer_);
    case Fault::Kind::stranger_copies:
      return repeat(bytes, {index, host(index).incarnation});
    default:
      return;
  }
}

void Play::command(int index, bool group) {
  Host& at = host(index);
  const auto id = static_cast<int>(world_.commands_.size());
  World::Sent sent;
  sent.host = index;
  sent.incarnation = at.incarnation;
  sent.asked_us = world_.now_us_;
  sent.group = group;
  world_.commands_.push_back(sent);
  Setpoints setpoints;
  for (int i = 1; i <= (group ? stepper_channels : 1); ++i)
    setpoints.add(Command::stepper(i, Steps(id), StepsPerSecond(1000)));
  const Time timeout{world_.schedule_.command_timeout_us};
  const Ticket ticket = at.session->send(setpoints, timeout, at.time());
  if (ticket != 0) at.tickets[ticket] = id;
  world_.poll_host(index);
}

void Play::kill(int index) {
  suspended_.erase(index);
  host(index).suspended = false;
  if (!host(index).alive) return;
  host(index).die();
  disturb_all(world_.now_us_);
}

void Play::start_after(int index, std::uint64_t us) {
  after(us, [this, index] {
    if (!host(index).alive) world_.start_host(index);
  });
}

// While the host's process does not run, the call waits.
void Play::when_it_runs(int index, std::function<void()> call) {
  if (runs(index)) return call();
  if (host(index).alive) suspended_[index].calls.push_back(std::move(call));
}

// While the host sleeps, the clocks of its programs stop, and it receives no datagram. After the
// sleep the host begins another session.
void Play::sleep(int index) {
  Host& at = host(index);
  if (!runs(index)) return;
  at.suspended = true;
  suspended_[index] = Suspended();
  disturb_all(world_.now_us_ + sleep_us);
  after(sleep_us, [this, index, incarnation = at.incarnation, slept_from = world_.now_us_] {
    Host& it = host(index);
    if (!it.alive || it.incarnation != incarnation || !it.suspended) return;
    const std::vector<std::function<void()>> calls = std::move(suspended_[index].calls);
    suspended_.erase(index);
    it.suspended = false;
    it.clock_offset_us -= sleep_us;
    it.session->on_sleep(it.time());
    // The promises treat the host as another process, because its session has ended.
    it.died_us = slept_from;
    ++it.incarnation;
    world_.poll_host(index);
    for (const auto& call : calls) when_it_runs(index, call);
  });
}

void Play::pause(int index) {
  Host& at = host(index);
  if (!runs(index)) return;
  at.suspended = true;
  suspended_[index] = Suspended();
  suspended_[index].keeps = true;
  disturb_all(world_.now_us_ + outage_us);
  after(outage_us, [this, index, incarnation = at.incarnation] {
    Host& it = host(index);
    if (!it.alive || it.incarnation != incarnation || !it.suspended) return;
    const Suspended waited = std::move(suspended_[index]);
    suspended_.erase(index);
    it.suspended = false;
    for (const Packet& packet : waited.arrived) deliver_in(0, packet);
    world_.poll_host(index);
    for (const auto& call : waited.calls) when_it_runs(index, call);
  });
}

}  // namespace r4::simulation
