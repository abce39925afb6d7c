// SPDX-License-Identifier: GPL-3.0-or-later
// Events from outside: the happenings of the schedule, and the attacker.
#include <fmt/format.h>

#include <utility>

#include "world_host.hpp"

namespace r4::simulation {

void World::happen(const Happening& happening, bool over) {
  const int index = static_cast<int>(&happening - schedule_.happenings.data());
  note(fmt::format("{} {} {}", to_text(happening.kind), over ? "over" : "begins", happening.host));
  const std::uint64_t end_us = now_us_ + happening.length_us;
  const bool watches =
      happening.kind == Happening::Kind::watch || happening.kind == Happening::Kind::watcher_stops;
  Host& host =
      watches ? watcher(happening.host) : *hosts_[static_cast<std::size_t>(happening.host)];
  switch (happening.kind) {
    case Happening::Kind::cut:
    case Happening::Kind::cut_to_board:
    case Happening::Kind::cut_to_host:
    case Happening::Kind::stall:
    case Happening::Kind::port_down:
      for (int w = 0; w < schedule_.paths(); ++w) {
        if ((happening.paths >> w & 1U) != 0) disturb(w, happening.kind, end_us);
      }
      return;
    case Happening::Kind::unplug:
      unplug(happening, over);
      break;
    case Happening::Kind::host_restart:
      if (over) {
        if (!host.alive) start_host(happening.host);
        return;
      }
      if (host.alive) host.die();
      break;
    case Happening::Kind::host_freeze:
      if (host.alive) {
        host.session->watchdog(std::chrono::milliseconds{over ? 0 : 100}, host.time());
      }
      host.frozen = !over;
      break;
    case Happening::Kind::board_restart:
      boot_board();
      return;
    case Happening::Kind::stop:
      if (!host.alive) return;
      if (over) {
        clear_stop(host);
      } else {
        stop(host);
      }
      break;
    case Happening::Kind::handle:
      handle_held_ = over;
      break;
    case Happening::Kind::obstacle:
      // A command sets the threshold, and can be lost or delayed like any command.
      if (!over && host.alive)
        host.session->post(Command::proximity(1, Centimetres(50)), host.time());
      distance_cm_ = over ? 200 : 10;
      break;
    case Happening::Kind::address:
      if (over && random_.chance(0.5)) return;
      for (Host::Place& place : host.places) {
        if ((happening.paths >> place.path & 1U) == 0) continue;
        disturb(place.path, happening.kind, now_us_);
        std::swap(place.peer, place.other_peer);
        if (place.peer == 0) place.peer = next_peer_++;
      }
      break;
    case Happening::Kind::leave:
      if (over) {
        if (!host.alive) start_host(happening.host);
        return;
      }
      if (host.alive && host.farewell_ticket == 0) leave(host);
      break;
    case Happening::Kind::stopper:
      call_stopper(*hosts_[static_cast<std::size_t>(schedule_.hosts)], over);
      break;
    case Happening::Kind::watch:
      watch(host, over);
      break;
    case Happening::Kind::watcher_stops:
      if (host.alive && !over) stop(host);
      return;
  }
  if (!over) at(end_us, Event::Kind::over, index);
}

void World::stop(Host& host) {
  const Ticket ticket = host.session->send(Command::stop(), Time{500'000}, host.time());
  if (ticket != 0) host.stops[ticket].pnum = host.stop_pnum;
  poll_host(host.index);
}

void World::leave(Host& host) {
  host.farewell_ticket = host.session->leave(Time{100'000}, host.time());
  if (host.farewell_ticket == 0) return host.die();
  poll_host(host.index);
}

// If the host has received the cause of the safe state, sends E:CLEAR.
void World::clear_stop(Host& host) {
  if (!host.session->knows_cause() || host.clear_ticket != 0) return;
  clear_asked_us_[{host.index, host.incarnation}] = now_us_;
  host.clear_ticket = host.session->send(Command::clear(), Time{500'000}, host.time());
  poll_host(host.index);
}

// `r4 stop` of another process, and the end of this process.
void World::call_stopper(Host& stopper, bool over) {
  if (over) {
    if (stopper.alive) stopper.die();
    return;
  }
  if (stopper.alive) return;
  stopper.begin();
  stop(stopper);
}

void World::attack() {
  at(now_us_ + random_.between(1, 2ULL * schedule_.attack_interval_us), Event::Kind::attack, 0);
  const Attack attack = attacker_.next(random_);
  if (attack.bytes.empty() || standing_) return;
  ++report_.attacks;
  note(fmt::format("attacker at {}: {} {}", attack.host, to_text(attack.kind), attack.bytes));
  constexpr std::uint32_t own_address = 0xFFFF;
  const std::uint8_t port = port_of(schedule_.attacked_path);
  std::uint32_t address = own_address;
  if (attack.host >= 0) {
    const Host::Place* const place =
        hosts_[static_cast<std::size_t>(attack.host)]->on(schedule_.attacked_path);
    if (place != nullptr) address = place->peer;
  }
  const BoardLink& link = board_->link();
  const BoardLinkState state = link.state();
  board_->poll(board_ms());  // the attacker does not cause the loss of a silent link
  const bool lost = link.state() != state;
  const std::uint32_t fed_ms = link.fed_ms();
  const Source source{port, address};
  const bool was_path = board_->paths().has(source);
  const std::uint32_t rejected = report_.rejected;
  attacking_ = true;
  delivering_ = {attack.host, 0};  // no process has this incarnation
  delivering_at_ = source;
  board_->receive(port, address, Text(attack.bytes), board_ms());
  attacking_ = false;
  Datagram datagram;
  if (attack.kind != Attack::Kind::stop && read_datagram(Text(attack.bytes), datagram) &&
      report_.rejected == rejected) {
    violate(fmt::format("forged: a {} was taken for signed", to_text(attack.kind)));
  }
  const bool joined = !was_path && board_->paths().has(source);
  if (link.fed_ms() != fed_ms || joined || (!lost && link.state() != state)) {
    violate(fmt::format("forged: a {} changed the link", to_text(attack.kind)));
  }
}

}  // namespace r4::simulation
