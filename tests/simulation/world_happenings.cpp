// SPDX-License-Identifier: GPL-3.0-or-later
// What comes from outside: the happenings of the schedule, and the attacker.
#include <fmt/format.h>

#include "world_host.hpp"

namespace r4::simulation {

void World::happen(const Happening& happening, bool over) {
  const int index = static_cast<int>(&happening - schedule_.happenings.data());
  note(fmt::format("{} {} {}", to_text(happening.kind), over ? "over" : "begins", happening.host));
  const std::uint64_t end_us = now_us_ + happening.length_us;
  Host& host = *hosts_[static_cast<std::size_t>(happening.host)];
  switch (happening.kind) {
    case Happening::Kind::cut:
      cut_to_board_until_us_ = cut_to_host_until_us_ = end_us;
      return;
    case Happening::Kind::cut_to_board:
      cut_to_board_until_us_ = end_us;
      return;
    case Happening::Kind::cut_to_host:
      cut_to_host_until_us_ = end_us;
      return;
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
    case Happening::Kind::port_down:
      board_->port_down(0, board_ms());
      return;
    case Happening::Kind::stop:
      if (!host.alive) return;
      if (over) {
        host.session->send(Command::clear(), Time{500'000}, host.time());
      } else {
        host.session->stop(Time{500'000}, host.time());
      }
      poll_host(happening.host);
      break;
    case Happening::Kind::handle:
      handle_held_ = over;
      break;
    case Happening::Kind::obstacle:
      // The threshold is set by command, so that it goes the way of all commands.
      if (!over && host.alive) host.session->post(Command::proximity(50, 1), host.time());
      distance_cm_ = over ? 200 : 10;
      break;
  }
  if (!over) at(end_us, Event::Kind::over, index);
}

void World::attack() {
  at(now_us_ + random_.between(1, 2ULL * schedule_.attack_interval_us), Event::Kind::attack, 0);
  const Attack attack = attacker_.next(random_);
  if (attack.bytes.empty()) return;
  ++report_.attacks;
  note(fmt::format("attacker at {}: {} {}", attack.host, to_text(attack.kind), attack.bytes));
  const BoardLink& link = board_->link();
  const BoardLinkState state = link.state();
  const std::uint32_t fed_ms = link.fed_ms();
  const Source owner = link.owner();
  const std::uint32_t rejected = report_.rejected;
  board_->poll(board_ms());  // so that silence is not taken for the attacker's doing
  const bool lost = link.state() != state;
  attacking_ = true;
  delivering_ = {attack.host, 0};  // no process has that incarnation
  constexpr std::uint32_t own_address = 99;
  board_->receive(0, attack.host < 0 ? own_address : static_cast<std::uint32_t>(attack.host + 1),
                  Text(attack.bytes), board_ms());
  attacking_ = false;
  Datagram datagram;
  if (attack.kind != Attack::Kind::stop && read(Text(attack.bytes), datagram) &&
      report_.rejected == rejected) {
    violate(fmt::format("forged: a {} was taken for signed", to_text(attack.kind)));
  }
  if (link.fed_ms() != fed_ms || link.owner() != owner || (!lost && link.state() != state)) {
    violate(fmt::format("forged: a {} changed the link", to_text(attack.kind)));
  }
}

}  // namespace r4::simulation
