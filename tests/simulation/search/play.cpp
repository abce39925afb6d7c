// SPDX-License-Identifier: GPL-3.0-or-later
#include "play.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "tests/simulation/world_host.hpp"

namespace r4::simulation {
namespace {

constexpr std::uint64_t late_us = 300'000;
constexpr std::uint64_t too_late_us = 1'300'000;
constexpr std::uint64_t promise_slack_us = 20'000;
constexpr std::uint64_t prompt_us = 100'000;

}  // namespace

Schedule Play::schedule_of(const Story& story) {
  Schedule schedule;
  schedule.duration_us = (story.faults_until_ms + Story::recovery_ms) * 1000ULL;
  schedule.hosts = story.hosts;
  schedule.settings.state_rate_hz = 5;
  schedule.more_paths.resize(static_cast<std::size_t>(story.paths) - 1);
  schedule.one_port = story.one_port;
  schedule.command_timeout_us = 2'000'000;
  schedule.keys = story.keys;
  schedule.watchers = 1;
  return schedule;
}

Play::Play(const Story& story, std::vector<Fault> faults, bool keep_trace,
           std::optional<std::uint32_t> confirmed, bool always_pushed)
    : story_(story),
      faults_(std::move(faults)),
      keep_trace_(keep_trace),
      confirmed_(confirmed),
      looks_for_pushed_(always_pushed),
      world_(schedule_of(story), *this, keep_trace) {
  for (const Fault& fault : faults_) {
    any_stranger_ = any_stranger_ || is_strangers(fault.kind);
    only_strangers_ = only_strangers_ && is_strangers(fault.kind);
  }
  looks_for_pushed_ = looks_for_pushed_ || any_stranger_;
}

void Play::set(SessionOptions& options) const {
  options.timing.heartbeat_ms = 250;
  options.command_retry = options.stop_retry = std::chrono::milliseconds{200};
  options.stop_linger = std::chrono::milliseconds{100};
  options.identify_interval = std::chrono::seconds{0};
  options.watch_rate_hz = 5;
}

bool Play::has_place(int host, int path) const {
  if (host == 0) return (story_.paths_of_first >> path & 1) != 0;
  return path == story_.paths - 1;
}

Play::Host& Play::host(int index) { return *world_.hosts_[static_cast<std::size_t>(index)]; }

bool Play::runs(int index) { return host(index).alive && !host(index).suspended; }

void Play::after(std::uint64_t us, std::function<void()> call) {
  calls_.push_back(std::move(call));
  world_.at(world_.now_us_ + us, World::Event::Kind::script, static_cast<int>(calls_.size()) - 1);
}

void Play::on_event(int index) {
  // Move the call out first: it may add calls, which may move the elements of calls_.
  const std::function<void()> call = std::move(calls_[static_cast<std::size_t>(index)]);
  call();
}

void Play::begin() {
  for (const Act& each : story_.acts) {
    after(each.at_ms * 1000ULL, [this, each] { act(each); });
  }
  first_peer_ = host(0).places.front().peer;
  for (int i = 1; story_.one_address && i < story_.hosts; ++i) {
    host(i).places.front().peer = first_peer_;
  }
  if (story_.bridge) {
    begin_bridge();
    tick_bridge();
  }
  renew_lease();
}

// --- the faults of datagrams

bool Play::applies(Fault fault) const {
  using Kind = Fault::Kind;
  const Step& step = steps_[static_cast<std::size_t>(fault.step)];
  if (step.at_us >= story_.faults_until_ms * 1000ULL) return false;
  if (is_of_datagram(fault.kind)) {
    // The host does not run, so these faults change nothing. But the host may run when a late
    // datagram arrives.
    const bool same =
        !step.to_board && !step.alive &&
        (fault.kind == Kind::lost || fault.kind == Kind::twice || fault.kind == Kind::overtaken);
    return step.passes && !same;
  }
  const bool is_host = step.host < story_.hosts;
  switch (fault.kind) {
    case Kind::cut:
    case Kind::cut_to_board:
    case Kind::cut_to_host:
    case Kind::cut_shortly:
    case Kind::held:
    case Kind::unplugged:
    case Kind::port_lost:
      return step.first_of_path;
    case Kind::restarts:
    case Kind::dies:
    case Kind::sleeps:
    case Kind::pauses:
      // The program that only stops the board ends soon, so these faults change nothing.
      return step.first_of_host && step.alive && step.host != story_.hosts;
    case Kind::moves:
      return step.first_of_path && step.alive && is_host;
    case Kind::stops:
    case Kind::clears:
      return step.first_of_host && step.alive && is_host;
    case Kind::stranger_elsewhere:
      return step.first && story_.paths > 1;
    case Kind::bridge_restarts:
      return step.first && story_.bridge;
    case Kind::stranger_copies:
      return story_.keys && step.to_board && is_host;
    default:
      return step.first;
  }
}

void Play::on_sent(const Packet& sent) {
  const auto number = static_cast<int>(steps_.size());
  const Host& at = host(sent.host);
  const int index = at.places[static_cast<std::size_t>(sent.place)].path;
  const World::Path& path = world_.paths_[index];
  Step step;
  step.at_us = world_.now_us_;
  step.to_board = sent.to_board;
  step.host = sent.host;
  step.path = index;
  step.passes =
      world_.now_us_ >= (sent.to_board ? path.cut_to_board_until_us : path.cut_to_host_until_us);
  step.alive = at.alive && !at.suspended;
  step.first = event_of_step_ != world_.handled_;
  if (step.first) hosts_of_event_.clear();
  event_of_step_ = world_.handled_;
  const std::pair<int, int> who{sent.host, index};
  for (const auto& before : hosts_of_event_) {
    step.first_of_host = step.first_of_host && before.first != who.first;
    step.first_of_path = step.first_of_path && before != who;
  }
  hosts_of_event_.push_back(who);
  if (keep_trace_) step.text = sent.bytes.substr(0, sent.bytes.find('^'));
  steps_.push_back(std::move(step));

  bool first_copy = steps_.back().passes;
  std::uint64_t first_us = delay_us;
  std::optional<std::uint64_t> second_us;
  bool waits = false;
  while (next_fault_ < faults_.size() && faults_[next_fault_].step == number) {
    const Fault::Kind kind = faults_[next_fault_++].kind;
    if (keep_trace_) world_.show(fmt::format("FAULT {}", text_of(kind)));
    switch (kind) {
      case Fault::Kind::lost:
        first_copy = false;
        break;
      case Fault::Kind::twice:
        second_us = delay_us + 1;
        break;
      case Fault::Kind::again_late:
        second_us = late_us;
        break;
      case Fault::Kind::again_too_late:
        second_us = too_late_us;
        break;
      case Fault::Kind::late:
        first_us = late_us;
        break;
      case Fault::Kind::too_late:
        first_us = too_late_us;
        break;
      case Fault::Kind::overtaken:
        waits = true;
        break;
      default:
        after(1, [this, kind, who, bytes = sent.bytes] {
          begin_fault(kind, who.first, who.second, bytes);
        });
        continue;
    }
    const std::uint64_t until_us = world_.now_us_ + std::max(first_us, second_us.value_or(0));
    world_.disturb(index, Happening::Kind::address, world_.now_us_);
    world_.paths_[index].disturbed_until_us =
        std::max(world_.paths_[index].disturbed_until_us, until_us + disturbed_us);
  }
  for (std::size_t i = 0; i < overtaken_.size(); ++i) {
    const Packet& before = overtaken_[i];
    const bool same =
        before.to_board == sent.to_board && before.host == sent.host && before.place == sent.place;
    if (!same) continue;
    deliver_in(delay_us + 1, before);
    world_.disturb(index, Happening::Kind::address, world_.now_us_);
    overtaken_.erase(overtaken_.begin() + static_cast<std::ptrdiff_t>(i--));
  }
  if (!first_copy) return;
  if (waits) {
    overtaken_.push_back(sent);
    return;
  }
  // A path keeps the order of the datagrams that it delays.
  const std::uint64_t held_us =
      path.stalled_until_us - std::min(path.stalled_until_us, world_.now_us_);
  deliver_in(std::max(held_us + delay_us, first_us), sent);
  if (second_us) deliver_in(std::max(held_us + delay_us, *second_us), sent);
}

void Play::deliver_in(std::uint64_t us, const Packet& packet) {
  const int slot = world_.take_slot();
  world_.packets_[static_cast<std::size_t>(slot)] = packet;
  world_.at(world_.now_us_ + us, World::Event::Kind::packet, slot);
}

bool Play::takes(const Packet& arrived) {
  if (arrived.to_board) return bridge_ && bridge_takes(arrived);
  const auto found = suspended_.find(arrived.host);
  if (found == suspended_.end()) return false;
  if (found->second.keeps) found->second.arrived.push_back(arrived);
  return true;
}

// --- the promises

std::string Play::name_of(Process process) const {
  if (process.host == stranger_host) return "a stranger";
  if (process.host < 0) return "nobody";
  return fmt::format("host {}, process {}", process.host, process.incarnation);
}

void Play::before_board(const Packet& packet) {
  const auto copied = copied_.find(packet.bytes);
  if (copied != copied_.end() && !std::exchange(copied->second.has_arrived, true)) {
    world_.delivering_ = copied->second.signer;
  }
  had_owner_ = world_.board_->link().has_owner();
  fed_before_ = world_.board_->link().fed_ms();
  if (!packet.intact || !packet.heartbeat) return;
  const Process from = world_.delivering_;
  heard_us_[from] = world_.now_us_;
  const auto newest = newest_.find(from);
  if (newest != newest_.end() && !newer(packet.pnum, newest->second)) return;
  newest_[from] = packet.pnum;
  if (!has_controller_ || from != controller_) return;
  Datagram datagram;
  if (!read_datagram(Text(packet.bytes), datagram) || datagram.time_ms() == 0) return;
  const std::uint32_t age_ms = world_.board_ms() - static_cast<std::uint32_t>(datagram.time_ms());
  const bool fresh = age_ms < world_.board_->settings().timeout_ms;
  const bool prompt = world_.now_us_ - packet.sent_us <= prompt_us;
  if (fresh && prompt && world_.board_->paths().has({packet.port, packet.peer})) {
    good_us_ = world_.now_us_;
  }
}

void Play::after_board(const Packet& packet) {
  const BoardLink& link = world_.board_->link();
  const Process from = world_.delivering_;
  const bool begins = link.has_owner() && !had_owner_;
  const bool feeds = link.has_owner() && had_owner_ && link.fed_ms() != fed_before_;
  if (!packet.heartbeat || !(begins || feeds) || (has_controller_ && from == controller_)) return;
  if (has_controller_ && link.last_executed() != 0) {
    return violate(begins ? fmt::format("resumed: {} resumes the session of {}", name_of(from),
                                        name_of(controller_))
                          : fmt::format("joined: {} keeps the session of {}", name_of(from),
                                        name_of(controller_)));
  }
  const std::uint64_t timeout_us = world_.board_->settings().timeout_ms * 1000ULL;
  if (looks_for_pushed_ && controller_.host >= 0 && feeds && executed_ &&
      world_.now_us_ - good_us_ < timeout_us - promise_slack_us) {
    violate(fmt::format("pushed: {} takes the board from {}", name_of(from), name_of(controller_)));
  }
  controller_ = from;
  has_controller_ = true;
  executed_ = false;
  stranger_controlled_ = stranger_controlled_ || from.host == stranger_host;
  good_us_ = world_.now_us_;
}

bool Play::on_executed(const Command& command) {
  if (command.kind == CommandKind::stop) return true;
  if (has_controller_ && world_.delivering_ != controller_) {
    violate(fmt::format("stranger: a command of {} is executed in the session of {}",
                        name_of(world_.delivering_), name_of(controller_)));
  }
  executed_ = true;
  if (command.kind == CommandKind::leave) may_be_lost_ = true;
  return command.kind != CommandKind::stepper || command.value != Stranger::target;
}

void Play::on_link_lost() { lost_now_ = true; }

void Play::check() {
  if (std::exchange(lost_now_, false) && !may_be_lost_ && executed_ && looks_for_pushed_ &&
      controller_.host >= 0) {
    const std::uint64_t timeout_us = world_.board_->settings().timeout_ms * 1000ULL;
    const std::uint64_t since_us = world_.now_us_ - good_us_;
    if (since_us < timeout_us - promise_slack_us) {
      violate(fmt::format("pushed: {} lost its link {} us after its heartbeat came",
                          name_of(controller_), since_us));
    }
  }
  may_be_lost_ = false;
  if (!world_.live_ || world_.standing_) return;
  const firmware::StepperTarget& stepper = world_.outputs_.stepper[0];
  if (!stepper.enabled) return;
  Process whose{stranger_host, 0};
  if (stepper.position != Stranger::target) {
    const World::Sent& sent = world_.commands_[static_cast<std::size_t>(stepper.position)];
    whose = {sent.host, sent.incarnation};
  }
  const std::uint64_t silent_us = world_.now_us_ - heard_us_[whose];
  if (silent_us > world_.board_->settings().timeout_ms * 1000ULL + promise_slack_us) {
    violate(fmt::format("silence: outputs of {} are live {} us after its last heartbeat",
                        name_of(whose), silent_us));
  }
}

void Play::end() {
  if (any_stranger_) {
    const bool served = only_strangers_ && !stranger_controlled_ && confirmed_;
    if (served && world_.report_.confirmed < *confirmed_) {
      violate(fmt::format("served: {} commands were confirmed, and {} are without strangers",
                          world_.report_.confirmed, *confirmed_));
    }
    return;
  }
  bool any = false;
  bool controls = false;
  for (int i = 0; i < story_.hosts; ++i) {
    if (!runs(i)) continue;
    any = true;
    controls = controls || host(i).session->in_control(host(i).time());
  }
  if (any && !controls) violate("returns: a host is there, and none is in control");
}

}  // namespace r4::simulation
