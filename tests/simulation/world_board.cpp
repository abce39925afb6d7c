// SPDX-License-Identifier: GPL-3.0-or-later
// The simulated board: the application on a HAL that only stores its outputs, and the promises
// about the board's actions.
#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <utility>

#include "world_host.hpp"

namespace r4::simulation {

namespace {

constexpr std::uint64_t slack_us = 20'000;

bool driven(const firmware::Outputs& outputs) { return outputs != firmware::Outputs(); }

}  // namespace

// The board's clock begins at random. Once in 200,000 boots, the clock begins by chance within 10 s
// of the earlier clock. A replay from the earlier boot then passes for a datagram of this boot
// (docs/design/safety-argument.md). This replay is not an error.
std::uint32_t World::first_time() {
  constexpr std::int32_t apart_ms = 60'000;
  std::uint32_t first = 0;
  const auto is_near = [&](std::uint32_t other) {
    const auto later = static_cast<std::int32_t>(first - other);
    return later > -apart_ms && later < apart_ms;
  };
  do {
    first = static_cast<std::uint32_t>(random_.next());
  } while (std::any_of(first_times_.begin(), first_times_.end(), is_near));
  first_times_.push_back(first);
  return first;
}

void World::boot_board() {
  ++board_generation_;
  boot_us_ = now_us_;
  boot_offset_ms_ = first_time();
  outputs_ = firmware::Outputs();
  live_ = stopped_ = false;
  had_owner_ = false;
  shown_.clear();
  fed_.clear();
  for (Path& path : paths_) path.brought_state = path.serves = false;
  standing_ = false;
  ports_lost_meanwhile_.clear();
  for (const int slot : waiting_) release(slot);
  waiting_.clear();
  firmware::Application::Config config;
  config.identity = Identity{Text("simulated"), Text("0"), Text("sim")};
  config.settings = schedule_.settings;
  std::uint8_t chance[Authentication::chance_size];
  leases_.clear();
  if (has_keys()) {
    for (int i = 0; i < schedule_.hosts; ++i) config.settings.site.keys[i] = key_of_host(i);
  }
  if (has_keys() || schedule_.watchers != 0) {
    for (std::uint8_t& byte : chance) byte = static_cast<std::uint8_t>(random_.next());
    config.chance = chance;
  }
  board_ = std::make_unique<firmware::Application>(*this, config, this);
  for (int i = 0; i < (schedule_.one_port ? 1 : schedule_.paths()); ++i)
    board_->add_port(ports_[i]);
  note("board boots");
  board_->start(board_ms());
  poll_board();
}

void World::poll_board() {
  const std::uint32_t now_ms = board_ms();
  const std::uint32_t wait_ms = board_->poll(now_ms);
  const std::uint64_t late_us = random_.below(schedule_.board_lateness_us + 1);
  const std::uint64_t wait_us = when_board_shows(now_ms + wait_ms) - when_board_shows(now_ms);
  at(now_us_ + wait_us + late_us, Event::Kind::board, 0, board_generation_);
}

void World::stand_still(const Standstill& standstill) {
  note("board stands still");
  ++report_.standstills;
  standing_ = true;
  at(now_us_ + standstill.length_us, Event::Kind::go_on, 0, ++board_generation_);
}

// Models a process with several sockets. The timer may fire before, between or after the waiting
// datagrams. The process may not notice that it has read all datagrams.
void World::go_on() {
  note("board goes on");
  standing_ = false;
  went_on_us_ = now_us_;
  ++board_generation_;
  const std::vector<int> waiting = std::exchange(waiting_, {});
  if (loop_random_.chance(0.5)) board_->poll(board_ms());
  for (const int slot : waiting) {
    ++report_.waited;
    hand_over(slot);
    if (loop_random_.chance(0.1)) board_->poll(board_ms());
  }
  for (const std::uint8_t port : std::exchange(ports_lost_meanwhile_, {})) {
    board_->port_down(port, board_ms());
  }
  if (loop_random_.chance(0.5)) {
    for (int w = 0; w < schedule_.paths(); ++w) board_->drained(port_of(w));
  }
  poll_board();
}

void World::lose_port(std::uint8_t port) {
  may_be_lost_ = true;
  if (standing_) {
    ports_lost_meanwhile_.insert(port);
  } else {
    board_->port_down(port, board_ms());
  }
}

void World::sample(firmware::Inputs& inputs) {
  inputs.handle = handle_held_ ? Handle::held : Handle::released;
  for (auto& cm : inputs.ultrasonic_cm) cm = 200;
  inputs.ultrasonic_cm[0] = distance_cm_;
}

void World::apply(const firmware::Outputs& outputs) {
  const bool came_back = !live_ && driven(outputs);
  outputs_ = outputs;
  live_ = driven(outputs);
  if (report_.groups_apart == 0) check_steppers();
  if (!came_back) return;
  // If a group was sent command by command, another channel may be the first channel.
  const auto first = std::find_if(std::begin(outputs.stepper), std::end(outputs.stepper),
                                  [](const firmware::StepperTarget& each) { return each.enabled; });
  const int id = first != std::end(outputs.stepper) ? first->position : 0;
  if (id == Stranger::target) return;
  if (id < 0 || id >= static_cast<int>(commands_.size())) return violate("intact: unknown output");
  const Sent& sent = commands_[static_cast<std::size_t>(id)];
  const Host& host = *hosts_[static_cast<std::size_t>(sent.host)];
  if (was_lost_ && id == newest_executed_ && sent.executed != 0) ++report_.restores;
  const bool gone = host.incarnation != sent.incarnation || !host.alive;
  if (gone && now_us_ - host.died_us > schedule_.settings.timeout_ms * 1000U + slack_us) {
    violate(fmt::format("restore: outputs of command {} came back long after its host died", id));
  }
}

// Steppers 2 to 4 are commanded only by groups, which give all four steppers the same target.
void World::check_steppers() {
  const firmware::StepperTarget(&steppers)[stepper_channels] = outputs_.stepper;
  for (int i = 2; i < stepper_channels; ++i) {
    if (steppers[i] != steppers[1]) violate("whole: the hardware got part of a group");
  }
  const std::size_t newest = static_cast<std::size_t>(steppers[0].position);
  if (steppers[0].enabled && newest < commands_.size() && commands_[newest].group &&
      steppers[1] != steppers[0]) {
    violate("whole: the hardware got the first of a group");
  }
}

void World::make_safe() {
  if (live_) {
    report_.worst_silence_us = std::max(report_.worst_silence_us, now_us_ - heartbeat_in_us_);
  }
  outputs_ = firmware::Outputs();
  live_ = false;
}

void World::check_silence() {
  if (!live_ || standing_) return;
  check_owner_of_outputs();
  const std::uint64_t timeout_us = board_->settings().timeout_ms * 1000U;
  std::uint64_t heard_us = fed_.empty() ? 0 : fed_.back().at_us;
  for (int i = 0; i < board_->paths().size(); ++i) {
    heard_us = std::max(heard_us, heard_us_[board_->paths()[i].peer]);
  }
  const std::uint64_t silent_us = now_us_ - heard_us;
  if (silent_us > timeout_us + slack_us) {
    violate(fmt::format("silence: outputs live {} us after the last heartbeat came", silent_us));
  }
  if (now_us_ - heartbeat_sent_us_ > 2 * timeout_us + slack_us) {
    violate(fmt::format("silence: outputs live {} us after the last heartbeat was sent",
                        now_us_ - heartbeat_sent_us_));
  }
}

void World::send(std::uint8_t port, Text datagram, Priority priority, std::uint32_t peer) {
  const std::string_view bytes(datagram.data(), datagram.size());
  Datagram sent;
  if (schedule_.watchers != 0 && read_datagram(datagram, sent)) {
    if (priority == Priority::state) check_stream(port, peer, sent);
    if (kind_of(sent) == MessageKind::nack) on_told(peer, sent);
  }
  tell_stranger(peer, priority, bytes);
  if (script_ != nullptr && script_->on_board_sent(port, peer, priority, bytes)) return;
  for (int i = 0; i < static_cast<int>(hosts_.size()); ++i) {
    const Host& host = *hosts_[static_cast<std::size_t>(i)];
    for (std::size_t at = 0; at < host.places.size(); ++at) {
      if (port_of(host.places[at].path) != port) continue;
      if (peer == everyone ? !host.watcher : peer == host.places[at].peer) {
        transfer(false, i, static_cast<int>(at), bytes);
      }
    }
  }
}

void World::on_state(std::uint32_t, firmware::BoardState state, SafeReason reason) {
  note(fmt::format("board {} {}", firmware::to_text(state), r4::to_text(reason)));
  if (state == firmware::BoardState::safe && reason == SafeReason::link) {
    ++report_.link_losses;
    if (serves_since(now_us_ - std::min(now_us_, settled_us))) {
      violate("paths: the link was lost beside a good path");
    }
  }
  was_lost_ = state == firmware::BoardState::safe && reason == SafeReason::link;
  if (script_ != nullptr && was_lost_) script_->on_link_lost();
}

void World::on_outputs(std::uint32_t, const firmware::Outputs& outputs) {
  note(fmt::format("board outputs of command {}", outputs.stepper[0].position));
}

void World::on_executed(std::uint32_t, std::uint32_t pnum, const Command& command) {
  note(fmt::format("board executes {} kind {} value {}", pnum, static_cast<int>(command.kind),
                   command.value));
  if (command.kind == CommandKind::leave) may_be_lost_ = true;
  if (script_ != nullptr && !script_->on_executed(command)) return;
  if (script_ == nullptr && delivering_.host == stranger_host) return on_strangers(command);
  if (attacking_ && command.kind != CommandKind::stop) return violate("forged: executed");
  if (command.kind == CommandKind::stop) {
    ++report_.stops;
    on_stop(pnum);
  }
  if (command.kind == CommandKind::clear) {
    ++report_.clears;
    const bool was_stopped = std::exchange(stopped_, board_->reason() == SafeReason::stop);
    const std::uint64_t asked_us = clear_asked_us_[delivering_];
    if (was_stopped && new_stop_us_ > asked_us) {
      violate(fmt::format("stop: taken away by an E:CLEAR that was asked for {} us before it",
                          new_stop_us_ - asked_us));
    }
  }
  if (command.kind == CommandKind::leave) {
    ++report_.farewells;
    if (fed_.empty() || fed_.back().from != delivering_) {
      violate("farewell: of a process that does not control the board");
    }
    if (live_ || board_->link().has_owner()) violate("farewell: executed, but not obeyed");
  }
  if (command.kind != CommandKind::stepper) return;
  const int id = command.value;
  if (id < 0 || id >= static_cast<int>(commands_.size())) {
    return violate("intact: executed a command that nobody sent");
  }
  Sent& sent = commands_[static_cast<std::size_t>(id)];
  sent.channels = static_cast<std::uint8_t>(sent.channels | 1U << (command.channel - 1));
  if (command.channel != 1) {  // the other channels of a group follow its first channel
    if (!sent.group || (sent.executed == 0 && !sent.apart))
      violate("intact: executed a command that nobody sent");
    return;
  }
  ++report_.executed;
  if (sent.group) ++report_.executed_groups;
  if (schedule_.attack_interval_us != 0) ++report_.executed_signed;
  if (++sent.executed > 1) violate(fmt::format("once: command {} executed again", id));
  if (sent.dead) violate(fmt::format("truth: command {} executed after its refusal", id));
  if (id < newest_executed_) {
    const Sent& newest = commands_[static_cast<std::size_t>(newest_executed_)];
    if (newest.host == sent.host) {
      violate(fmt::format("order: command {} executed after {}", id, newest_executed_));
    }
  }
  if (stop_from_ == delivering_ && newer(stop_pnum_, pnum)) {
    violate(fmt::format("order: command {} is older than the stop before it", id));
  }
  const std::uint64_t limit_us = 2U * board_->settings().timeout_ms * 1000U + 250'000 + slack_us;
  if (now_us_ - sent.transmitted_us > limit_us) {
    violate(fmt::format("fresh: command {} executed {} us after it was sent", id,
                        now_us_ - sent.transmitted_us));
  }
  const std::uint32_t unseen_ms =
      schedule_.standstills.empty() ? 0 : firmware::Application::standstill_ms;
  // The board's clock, which may be slow, measures this time.
  const std::uint64_t overtaken_us = (BoardLink::late_limit_ms + unseen_ms + 1) * 1001U;
  for (const Fed& fed : fed_) {
    const bool overtook = fed.from == delivering_ && newer(fed.pnum, pnum);
    if (overtook && now_us_ - fed.at_us > overtaken_us) {
      violate(fmt::format("late: command {} was overtaken {} us before", id, now_us_ - fed.at_us));
      break;
    }
  }
  if (!controls(delivering_) || delivering_.host != sent.host) {
    violate(fmt::format("intact: command {} is of a host that does not control", id));
  }
  newest_executed_ = std::max(newest_executed_, id);
}

// True if the board has a host and `process` is this host.
bool World::controls(const Process& process) const {
  return board_->link().has_owner() && !fed_.empty() && fed_.back().from == process;
}

// The board has handled a command. The board must have executed the whole command or nothing.
void World::check_whole(int id) {
  const Sent& sent = commands_[static_cast<std::size_t>(id)];
  const std::uint8_t all = sent.group ? (1U << stepper_channels) - 1 : 1;
  if (!sent.apart && sent.channels != 0 && sent.channels != all) {
    violate(fmt::format("whole: of command {} channels {:04b} were executed", id, sent.channels));
  }
}

// The board obeys a stop. A repetition of the last stop changes nothing, also if an attacker
// repeats the number.
void World::on_stop(std::uint32_t pnum) {
  if (attacking_ && stopped_ && stop_pnum_ == pnum) return;
  if (!stopped_ || stop_from_ != delivering_ || stop_pnum_ != pnum) new_stop_us_ = now_us_;
  stopped_ = true;
  stop_from_ = delivering_;
  stop_pnum_ = pnum;
  if (attacking_) attacker_stops_.insert(pnum);
  if (delivering_.host < 0) return;
  Host& host = *hosts_[static_cast<std::size_t>(delivering_.host)];
  if (delivering_.incarnation < host.began_as) return;
  for (auto& [ticket, stop] : host.stops) stop.executed = stop.executed || stop.pnum == pnum;
}

void World::on_refused(std::uint32_t, std::uint32_t pnum, Refusal code) {
  report_.busy += code == Refusal::busy;
  report_.stale += code == Refusal::stale;
  report_.duplicate += code == Refusal::duplicate;
  note(fmt::format("board refuses {} {}", pnum, static_cast<int>(code)));
}

void World::on_rejected(std::uint32_t, Verdict verdict) {
  ++report_.rejected;
  note(fmt::format("board drops it: signature {}", r4::to_text(verdict)));
}

}  // namespace r4::simulation
