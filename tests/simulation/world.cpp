// SPDX-License-Identifier: GPL-3.0-or-later
#include "world.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "tests/support/signing.hpp"

namespace r4::simulation {

namespace {

constexpr std::uint64_t slack_us = 20'000;

Key key_of_host(int index) { return test::key_of(static_cast<std::uint8_t>(index + 1)); }

bool driven(const firmware::Outputs& outputs) { return outputs != firmware::Outputs(); }

}  // namespace

// A host process: a session, and an application that commands through it.
struct World::Host final : Session::Handler {
  Host(World& w, int i) : world(w), index(i) {}

  void begin() {
    ++incarnation;
    alive = true;
    clock_offset_us = world.random_.below(1'000'000'000);
    const auto first =
        echo_host_first_pnum + static_cast<std::uint32_t>(world.random_.below(1U << 30));
    SessionOptions options;
    if (world.schedule_.attack_interval_us != 0) {
      options.key = key_of_host(index);
      options.clock_start = std::chrono::hours{24} - Time{clock_offset_us};
    }
    session = std::make_unique<Session>(*this, options, first);
    tickets.clear();
  }
  void die() {
    alive = false;
    died_us = world.now_us_;
    session.reset();
  }
  Time time() const { return Time{static_cast<std::int64_t>(world.now_us_ + clock_offset_us)}; }

  void transmit(std::string_view bytes, Priority) override { world.transfer(true, index, bytes); }
  void on_state(const State&, const Datagram&) override {}
  void on_board_heartbeat(const Datagram&) override {}
  void on_identity(const Identity&) override {}
  void on_nack(const Nack& nack, const Datagram&) override {
    world.report_.busy += nack.code == Refusal::busy;
    world.report_.stale += nack.code == Refusal::stale;
    world.report_.duplicate += nack.code == Refusal::duplicate;
  }
  void on_bad_datagram(const ReadResult&, std::string_view) override {}
  void on_link(const LinkStatus& status) override {
    world.note(fmt::format("host {} link {} safe {} busy {}", index, r4::to_text(status.state),
                           r4::to_text(status.reason), status.busy));
  }
  void on_result(Ticket ticket, const CommandResult& result) override {
    const auto found = tickets.find(ticket);
    if (found == tickets.end()) return;
    const int id = found->second;
    tickets.erase(found);
    Sent& sent = world.commands_[static_cast<std::size_t>(id)];
    world.note(fmt::format("host {} command {} outcome {} {}", index, id,
                           static_cast<int>(result.outcome), static_cast<int>(result.code)));
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
        if (sent.executed != 0) {
          world.violate(fmt::format("truth: command {} refused but executed", id));
        }
        break;
      case Outcome::timed_out:
        ++world.report_.timed_out;
        break;
      case Outcome::cancelled:
      case Outcome::full:
        break;
    }
  }

  World& world;
  int index;
  std::uint32_t incarnation = 0;
  bool alive = false;
  bool frozen = false;
  std::uint64_t died_us = 0;
  std::uint64_t clock_offset_us = 0;
  std::uint64_t next_poll_us = 0;
  std::uint32_t poll_generation = 0;
  std::unique_ptr<Session> session;
  std::map<Ticket, int> tickets;
};

World::World(std::uint64_t seed, bool keep_trace) : random_(seed), keep_trace_(keep_trace) {
  schedule_ = Schedule::random(random_);
  report_.seed = seed;
}

World::World(std::uint64_t seed, Schedule schedule, bool keep_trace)
    : random_(seed), schedule_(std::move(schedule)), keep_trace_(keep_trace) {
  report_.seed = seed;
}

World::~World() = default;

Report World::run() {
  report_.trace_hash = 0xcbf29ce484222325U;
  commands_.emplace_back();  // 0 is where steppers stand: no command is named so
  boot_board();
  for (int i = 0; i < schedule_.hosts; ++i) {
    hosts_.push_back(std::make_unique<Host>(*this, i));
    start_host(i);
    at(random_.below(300'000), Event::Kind::command, i);
  }
  for (std::size_t i = 0; i < schedule_.happenings.size(); ++i) {
    at(schedule_.happenings[i].at_us, Event::Kind::happening, static_cast<int>(i));
  }
  if (schedule_.attack_interval_us != 0) at(0, Event::Kind::attack, 0);
  while (!events_.empty() && report_.violation.empty()) {
    const Event event = events_.top();
    if (event.at_us > schedule_.duration_us) break;
    events_.pop();
    now_us_ = event.at_us;
    switch (event.kind) {
      case Event::Kind::packet:
        deliver(event.index);
        break;
      case Event::Kind::board:
        if (event.generation == board_generation_) poll_board();
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
      case Event::Kind::over:
        happen(schedule_.happenings[static_cast<std::size_t>(event.index)], true);
        break;
    }
    check_silence();
  }
  over_ = true;
  return std::move(report_);
}

void World::at(std::uint64_t time_us, Event::Kind kind, int index, std::uint32_t generation) {
  events_.push(Event{time_us, order_++, kind, index, generation});
}

std::uint32_t World::board_ms() const {
  return boot_offset_ms_ + static_cast<std::uint32_t>((now_us_ - boot_us_) / 1000);
}

// --- the board

void World::boot_board() {
  ++board_generation_;
  boot_us_ = now_us_;
  boot_offset_ms_ = static_cast<std::uint32_t>(random_.next());
  outputs_ = firmware::Outputs();
  live_ = false;
  fed_.clear();
  firmware::Application::Config config;
  config.identity = Identity{Text("simulated"), Text("0"), Text("sim")};
  config.settings = schedule_.settings;
  std::uint8_t chance[Authentication::chance_size];
  if (schedule_.attack_interval_us != 0) {
    for (int i = 0; i < schedule_.hosts; ++i) config.settings.site.keys[i] = key_of_host(i);
    for (std::uint8_t& byte : chance) byte = static_cast<std::uint8_t>(random_.next());
    config.chance = chance;
  }
  board_ = std::make_unique<firmware::Application>(*this, config, this);
  board_->add_port(*this);
  note("board boots");
  board_->start(board_ms());
  poll_board();
}

void World::poll_board() {
  const std::uint32_t wait_ms = board_->poll(board_ms());
  const std::uint64_t late_us = random_.below(schedule_.board_lateness_us + 1);
  at(now_us_ + wait_ms * 1000 + late_us, Event::Kind::board, 0, board_generation_);
}

void World::sample(firmware::Inputs& inputs) {
  inputs.handle_held = handle_held_;
  for (auto& cm : inputs.ultrasonic_cm) cm = 200;
  inputs.ultrasonic_cm[0] = distance_cm_;
}

void World::apply(const firmware::Outputs& outputs) {
  const bool came_back = !live_ && driven(outputs);
  outputs_ = outputs;
  live_ = driven(outputs);
  if (!came_back) return;
  const int id = outputs.stepper[0].position;
  if (id < 0 || id >= static_cast<int>(commands_.size())) return violate("intact: unknown output");
  const Sent& sent = commands_[static_cast<std::size_t>(id)];
  const Host& host = *hosts_[static_cast<std::size_t>(sent.host)];
  if (was_lost_ && id == newest_executed_ && sent.executed != 0) ++report_.restores;
  const bool gone = host.incarnation != sent.incarnation || !host.alive;
  if (gone && now_us_ - host.died_us > schedule_.settings.timeout_ms * 1000U + slack_us) {
    violate(fmt::format("restore: outputs of command {} came back long after its host died", id));
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
  if (!live_) return;
  const std::uint64_t timeout_us = board_->settings().timeout_ms * 1000U;
  if (now_us_ - heartbeat_in_us_ > timeout_us + slack_us) {
    violate(fmt::format("silence: outputs live {} us after the last heartbeat came",
                        now_us_ - heartbeat_in_us_));
  }
  if (now_us_ - heartbeat_sent_us_ > 2 * timeout_us + slack_us) {
    violate(fmt::format("silence: outputs live {} us after the last heartbeat was sent",
                        now_us_ - heartbeat_sent_us_));
  }
}

void World::send(Text datagram, firmware::Urgency, std::uint32_t peer) {
  const std::string_view bytes(datagram.data(), datagram.size());
  for (int i = 0; i < static_cast<int>(hosts_.size()); ++i) {
    if (peer == firmware::everyone || peer == static_cast<std::uint32_t>(i + 1)) {
      transfer(false, i, bytes);
    }
  }
}

void World::on_state(std::uint32_t, firmware::BoardState state, SafeReason reason) {
  note(fmt::format("board {} {}", firmware::to_text(state), r4::to_text(reason)));
  if (state == firmware::BoardState::safe && reason == SafeReason::link) ++report_.link_losses;
  was_lost_ = state == firmware::BoardState::safe && reason == SafeReason::link;
}

void World::on_outputs(std::uint32_t, const firmware::Outputs& outputs) {
  note(fmt::format("board outputs of command {}", outputs.stepper[0].position));
}

void World::on_executed(std::uint32_t, std::uint32_t pnum, const Command& command) {
  note(fmt::format("board executes {} kind {} value {}", pnum, static_cast<int>(command.kind),
                   command.value));
  if (attacking_ && command.kind != CommandKind::stop) return violate("forged: executed");
  if (command.kind == CommandKind::stop) {
    ++report_.stops;
    stop_from_ = delivering_;
    stop_pnum_ = pnum;
  }
  if (command.kind != CommandKind::stepper) return;
  ++report_.executed;
  if (schedule_.attack_interval_us != 0) ++report_.executed_signed;
  const int id = command.value;
  if (id < 0 || id >= static_cast<int>(commands_.size()) || command.channel != 1) {
    return violate("intact: executed a command that nobody sent");
  }
  Sent& sent = commands_[static_cast<std::size_t>(id)];
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
  for (const Fed& fed : fed_) {
    const bool overtook = fed.from == delivering_ && newer(fed.pnum, pnum);
    if (overtook && now_us_ - fed.at_us > BoardLink::late_limit_ms * 1000U + 1000) {
      violate(fmt::format("late: command {} was overtaken {} us before", id, now_us_ - fed.at_us));
      break;
    }
  }
  if (board_->link().owner().peer != static_cast<std::uint32_t>(sent.host + 1)) {
    violate(fmt::format("intact: command {} is of a host that does not control", id));
  }
  newest_executed_ = std::max(newest_executed_, id);
}

void World::on_refused(std::uint32_t, std::uint32_t pnum, Refusal code) {
  note(fmt::format("board refuses {} {}", pnum, static_cast<int>(code)));
}

void World::on_rejected(std::uint32_t, Verdict verdict) {
  ++report_.rejected;
  note(fmt::format("board drops it: signature {}", r4::to_text(verdict)));
}

// --- the hosts

void World::start_host(int index) {
  Host& host = *hosts_[static_cast<std::size_t>(index)];
  host.begin();
  poll_host(index);
}

void World::poll_host(int index) {
  Host& host = *hosts_[static_cast<std::size_t>(index)];
  if (!host.alive) return;
  if (!host.frozen) host.session->feed(host.time());
  const Time next = host.session->poll(host.time());
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
  commands_.push_back(sent);
  const Command command = Command::stepper(id, 1000, 1);
  if (random_.chance(schedule_.post_share)) {
    host.session->post(command, host.time());
  } else {
    const Time timeout{schedule_.command_timeout_us};
    // The ticket is known only after send(), which may already transmit.
    const Ticket ticket = host.session->send(command, timeout, host.time());
    if (ticket != 0) host.tickets[ticket] = id;
  }
  poll_host(index);
}

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

// --- the channel

void World::transfer(bool to_board, int host, std::string_view bytes) {
  if (to_board) {
    attacker_.on_sent(host, bytes);
  } else {
    attacker_.on_board(bytes);
  }
  mix(bytes.data(), bytes.size());
  if (keep_trace_) show(fmt::format("{} host {} {}", to_board ? "->" : "<-", host, bytes));
  const ChannelFaults& faults = to_board ? schedule_.to_board : schedule_.to_host;
  Datagram datagram;
  bool heartbeat = false;
  std::uint32_t pnum = 0;
  int command = -1;
  if (to_board && read(Text(bytes), datagram)) {
    heartbeat = kind_of(datagram) == MessageKind::host_heartbeat;
    pnum = datagram.pnum();
    Command parsed;
    if (datagram.command_count() == 1 &&
        parse_command(datagram.command(), parsed) == Refusal::none &&
        parsed.kind == CommandKind::stepper) {
      command = parsed.value;
      commands_[static_cast<std::size_t>(command)].transmitted_us = now_us_;
    }
  }
  const std::uint64_t cut_until = to_board ? cut_to_board_until_us_ : cut_to_host_until_us_;
  if (now_us_ < cut_until) return;
  const int copies = 1 + (random_.chance(faults.duplicate) ? 1 : 0);
  for (int i = 0; i < copies; ++i) {
    if (random_.chance(faults.loss)) continue;
    int slot;
    if (free_packets_.empty()) {
      slot = static_cast<int>(packets_.size());
      packets_.emplace_back();
    } else {
      slot = free_packets_.back();
      free_packets_.pop_back();
    }
    Packet& packet = packets_[static_cast<std::size_t>(slot)];
    packet.to_board = to_board;
    packet.host = host;
    packet.incarnation = hosts_[static_cast<std::size_t>(host)]->incarnation;
    packet.heartbeat = heartbeat;
    packet.pnum = pnum;
    packet.command = command;
    packet.sent_us = now_us_;
    packet.intact = true;
    packet.bytes.assign(bytes);
    if (random_.chance(faults.corrupt)) {
      packet.intact = false;
      switch (random_.below(4)) {
        case 0:
          for (std::uint64_t n = random_.between(1, 4); n != 0; --n) {
            char& byte = packet.bytes[random_.below(packet.bytes.size())];
            byte = static_cast<char>(byte ^ static_cast<char>(1U << random_.below(8)));
          }
          break;
        case 1:
          packet.bytes.resize(random_.below(packet.bytes.size()));
          break;
        case 2:
          packet.bytes.insert(random_.below(packet.bytes.size()), 1, '5');
          break;
        default:
          packet.bytes.erase(random_.below(packet.bytes.size()), 1);
          break;
      }
      // Still intact if only the case of a checksum digit changed: the content is as it was sent.
      Datagram changed;
      const std::size_t content = bytes.find('^');
      packet.intact = read(Text(packet.bytes), changed) &&
                      packet.bytes.compare(0, content + 1, bytes, 0, content + 1) == 0;
    }
    std::uint64_t delay = faults.delay_us + random_.below(faults.jitter_us + 1);
    if (random_.chance(faults.straggle)) delay += random_.below(faults.straggle_us + 1);
    at(now_us_ + delay, Event::Kind::packet, slot);
  }
}

void World::deliver(int slot) {
  // Receiving may transfer, and so move packets_: take the packet out first.
  Packet packet = std::move(packets_[static_cast<std::size_t>(slot)]);
  mix(packet.bytes.data(), packet.bytes.size());
  if (packet.to_board) {
    if (keep_trace_) show(fmt::format("board receives {}", packet.bytes));
    if (packet.intact && packet.heartbeat) {
      heartbeat_in_us_ = now_us_;
      heartbeat_sent_us_ = std::max(heartbeat_sent_us_, packet.sent_us);
    }
    const auto peer = static_cast<std::uint32_t>(packet.host + 1);
    const std::uint32_t fed_before = board_->link().fed_ms();
    delivering_ = {packet.host, packet.incarnation};
    board_->receive(0, peer, Text(packet.bytes), board_ms());
    attacker_.on_received(packet.host, packet.bytes);
    const BoardLink& link = board_->link();
    if (packet.intact && packet.heartbeat && link.owner().peer == peer &&
        link.fed_ms() != fed_before && link.fed_ms() == board_ms()) {
      fed_.push_back({delivering_, packet.pnum, now_us_});
    }
  } else {
    Host& host = *hosts_[static_cast<std::size_t>(packet.host)];
    if (host.alive) {
      host.session->receive(packet.bytes, host.time());
      poll_host(packet.host);
    }
  }
  packets_[static_cast<std::size_t>(slot)] = std::move(packet);
  free_packets_.push_back(slot);
}

// --- the trace

void World::mix(const void* data, std::size_t size) {
  const auto* bytes = static_cast<const unsigned char*>(data);
  auto add = [this](unsigned char byte) {
    report_.trace_hash = (report_.trace_hash ^ byte) * 0x100000001b3U;
  };
  for (int i = 0; i < 8; ++i) add(static_cast<unsigned char>(now_us_ >> (8 * i)));
  for (std::size_t i = 0; i < size; ++i) add(bytes[i]);
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
