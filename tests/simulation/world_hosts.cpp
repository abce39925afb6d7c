// SPDX-License-Identifier: GPL-3.0-or-later
// The hosts: when they poll, which commands they send, and whether their results are true.
#include <fmt/format.h>

#include <algorithm>

#include "world_host.hpp"

namespace r4::simulation {

void World::Host::on_result(Ticket ticket, const CommandResult& result) {
  if (ticket == clear_ticket) {
    clear_ticket = 0;
    if (result.outcome == Outcome::refused) ++world.report_.clears_refused;
    return;
  }
  if (ticket == farewell_ticket) {
    leaving = true;
    if (result.outcome != Outcome::confirmed) return;
    ++world.report_.farewells_confirmed;
    if (world.controls({index, incarnation})) world.violate("farewell: confirmed, but not obeyed");
    return;
  }
  if (const auto stop = stops.find(ticket); stop != stops.end()) {
    world.note(fmt::format("host {} stop outcome {}", index, static_cast<int>(result.outcome)));
    if (result.outcome == Outcome::confirmed) {
      ++world.report_.stops_confirmed;
      // An attacker may have guessed the number, because the board's datagrams are not signed.
      const bool guessed = world.attacker_stops_.count(stop->second.pnum) != 0;
      if (!stop->second.executed && !guessed) world.violate("stop: confirmed but not obeyed");
      leaving = stopper && world.random_.chance(0.5);
    }
    return;
  }
  const auto found = tickets.find(ticket);
  if (found == tickets.end()) return;
  const int id = found->second;
  tickets.erase(found);
  Sent& sent = world.commands_[static_cast<std::size_t>(id)];
  world.note(fmt::format("host {} command {} outcome {} {}", index, id,
                         static_cast<int>(result.outcome), static_cast<int>(result.code)));
  world.report_.timed_on_good += index == 0 && world.serves_since(sent.asked_us);
  switch (result.outcome) {
    case Outcome::confirmed:
      ++world.report_.confirmed;
      if (sent.executed == 0) {
        world.violate(fmt::format("truth: command {} confirmed but never executed", id));
      }
      break;
    case Outcome::refused:
      ++world.report_.refused;
      sent.dead = true;
      // If a group was sent command by command, some commands may have been executed before a
      // command was refused.
      if (sent.executed != 0 && !sent.apart) {
        world.violate(fmt::format("truth: command {} refused but executed", id));
      }
      break;
    case Outcome::timed_out:
      ++world.report_.timed_out;
      if (index == 0 && world.should_be_confirmed(sent)) {
        world.violate(fmt::format("paths: command {} timed out beside a good path", id));
      }
      break;
    case Outcome::none:
    case Outcome::cancelled:
    case Outcome::closed:
    case Outcome::blocked:
    case Outcome::full:
    case Outcome::not_armed:
      break;
  }
}

void World::start_host(int index) {
  Host& host = *hosts_[static_cast<std::size_t>(index)];
  host.begin();
  poll_host(index);
}

void World::poll_host(int index) {
  Host& host = *hosts_[static_cast<std::size_t>(index)];
  if (!host.alive || host.suspended) return;
  if (host.leaving) return host.die();
  if (!host.frozen) host.session->feed(host.time());
  const Time next = host.session->poll(host.time());
  if (host.leaving) return host.die();
  const std::uint64_t at_us = std::max<std::uint64_t>(
      static_cast<std::uint64_t>(next.count()) - host.clock_offset_us, now_us_ + 1);
  at(at_us, Event::Kind::host, index, ++host.poll_generation);
}

void World::issue_command(int index) {
  Host& host = *hosts_[static_cast<std::size_t>(index)];
  at(now_us_ + random_.between(1, 2ULL * schedule_.command_interval_us), Event::Kind::command,
     index);
  if (!host.alive || host.frozen) return;
  const int id = static_cast<int>(commands_.size());
  Sent sent;
  sent.host = index;
  sent.incarnation = host.incarnation;
  sent.asked_us = now_us_;
  sent.group = random_.chance(schedule_.group_share);
  commands_.push_back(sent);
  Setpoints setpoints;
  for (int i = 1; i <= (sent.group ? stepper_channels : 1); ++i)
    setpoints.add(Command::stepper(i, Steps(id), StepsPerSecond(1000)));
  if (random_.chance(schedule_.post_share)) {
    host.session->post(setpoints, host.time());
  } else {
    const Time timeout{schedule_.command_timeout_us};
    // The ticket is known only after send(), which may already send the command.
    const Ticket ticket = host.session->send(setpoints, timeout, host.time());
    if (ticket != 0) host.tickets[ticket] = id;
  }
  poll_host(index);
}

}  // namespace r4::simulation
