// SPDX-License-Identifier: GPL-3.0-or-later
// The stranger of a random schedule, and the promises about the stranger's limits.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "world_host.hpp"

namespace r4::simulation {

namespace {

constexpr std::uint64_t slack_of_loss_us = 20'000;

}  // namespace

// The stranger receives all states and heartbeats, as a watcher does, and the answers to its own
// datagrams.
void World::tell_stranger(std::uint32_t peer, Priority priority, std::string_view bytes) {
  if (schedule_.stranger_interval_us == 0) return;
  const bool heartbeat = bytes.substr(0, 2) == "H:";
  if (heartbeat) on_board_heartbeat(bytes);
  if (priority == Priority::state || heartbeat || peer == Stranger::address) {
    stranger_.hears(bytes);
  }
}

// Keeps the T of the newest heartbeats of the board. An echo of an older T does not feed.
void World::on_board_heartbeat(std::string_view bytes) {
  constexpr std::size_t most_shown = 64;
  Datagram datagram;
  if (!read_datagram(Text(bytes), datagram) || datagram.time_ms() == 0) return;
  const auto t = static_cast<std::uint32_t>(datagram.time_ms());
  if (std::find(shown_.begin(), shown_.end(), t) != shown_.end()) return;
  shown_.push_back(t);
  if (shown_.size() > most_shown) shown_.erase(shown_.begin());
}

// The stranger's datagrams arrive undamaged and at once. Some datagrams have a host's address.
void World::stranger() {
  at(now_us_ + stranger_random_.between(1, 2ULL * schedule_.stranger_interval_us),
     Event::Kind::stranger, 0);
  if (standing_) return;
  board_->poll(board_ms());  // the stranger does not cause the loss of a silent link
  const BoardLink& link = board_->link();
  const bool had_owner = link.has_owner();
  const Process owner = fed_.empty() ? Process() : fed_.back().from;
  const bool of_host = had_owner && owner.host >= 0;
  if (!of_host && !stranger_random_.chance(schedule_.stranger_claims)) return;
  ++report_.strangers;

  const Host& host = *hosts_[of_host ? static_cast<std::size_t>(owner.host) : 0];
  Packet packet;
  packet.bytes = stranger_.say(stranger_random_, host.next_pnum);
  describe(packet);
  packet.port = port_of(schedule_.attacked_path);
  packet.peer = Stranger::address;
  if (stranger_random_.chance(0.3)) {
    const Host::Place* const place =
        hosts_[stranger_random_.below(hosts_.size())]->on(schedule_.attacked_path);
    if (place != nullptr) packet.peer = place->peer;
  }
  note(fmt::format("stranger at {}: {}", packet.peer, packet.bytes));

  const Source source{packet.port, packet.peer};
  const auto name = static_cast<std::uint32_t>(packet.sid != no_session ? packet.sid : packet.peer);
  const Process its{stranger_host, name};
  const std::uint32_t fed_ms = link.fed_ms();
  const bool was_path = board_->paths().has(source);
  const HostId controller = fed_.empty() ? HostId() : fed_.back().id;
  const auto admits = [&] { return link.admit(controller, host.next_pnum, board_ms()); };
  const Refusal admitted = admits();
  delivering_ = its;
  delivering_at_ = source;
  board_->receive(packet.port, packet.peer, Text(packet.bytes), board_ms());

  const bool began = link.has_owner() && !had_owner;
  const bool fed = began || link.fed_ms() != fed_ms;
  if (had_owner && owner != its) {
    const bool joined = !was_path && board_->paths().has(source);
    if (!link.has_owner() || fed || joined) violate("stranger: it changes the session of another");
    if (admits() != admitted) violate("stranger: it spends a number of the session of another");
    return;
  }
  if (!fed) return;
  if (began && owner != its) {
    ++report_.strangers_sessions;
    std::uint32_t first = 0;
    const bool numbered = link.first_heartbeat({source, packet.sid}, first);
    if (link.last_executed() != 0 || (numbered && first != packet.pnum)) {
      violate("stranger: it resumes the session of another");
    }
  }
  fed_.push_back({its, packet.pnum, now_us_, {source, packet.sid}});
  good_us_ = heartbeat_in_us_ = heartbeat_sent_us_ = heard_us_[packet.peer] = now_us_;
}

// In its own session, the stranger commands as any host does.
void World::on_strangers(const Command& command) {
  ++report_.strangers_executed;
  if (fed_.empty() || fed_.back().from != delivering_) {
    violate("stranger: its command is executed in the session of another");
  }
  if (command.kind == CommandKind::clear) stopped_ = board_->reason() == SafeReason::stop;
}

// True if this is the newest heartbeat of the host in control, is in time, and echoes a recent
// heartbeat of the board that is younger than the timeout. With keys and with standstills the
// result is uncertain, so the function returns false.
bool World::has_to_feed(const Packet& packet) const {
  if (has_keys() || !schedule_.standstills.empty() || packet.host < 0) return false;
  if (!packet.intact || !packet.heartbeat) return false;
  const auto t = static_cast<std::uint32_t>(packet.t);
  if (std::find(shown_.begin(), shown_.end(), t) == shown_.end()) return false;
  // A host may have begun another session.
  if (!controls(delivering_) || packet.sid != fed_.back().id.sid || !is_in_time()) return false;
  const std::uint32_t ahead = packet.pnum - fed_.back().pnum;
  return ahead != 0 && ahead <= BoardLink::command_window &&
         board_ms() - t < board_->settings().timeout_ms;
}

void World::check_owner_of_outputs() {
  const firmware::StepperTarget& stepper = outputs_.stepper[0];
  if (script_ != nullptr || !stepper.enabled || fed_.empty()) return;
  const Process& owner = fed_.back().from;
  bool owned = stepper.position == Stranger::target && owner.host == stranger_host;
  if (stepper.position >= 0) {
    const Sent& sent = commands_[static_cast<std::size_t>(stepper.position)];
    owned = owner == Process{sent.host, sent.incarnation};
  }
  if (!owned) violate("owned: live outputs are of a process that is not in control");
}

// True if silence must not end the link.
bool World::is_in_time() const {
  return now_us_ - good_us_ < board_->settings().timeout_ms * 1000ULL - slack_of_loss_us;
}

void World::check_lost() {
  const bool has_owner = board_->link().has_owner();
  const bool lost = std::exchange(had_owner_, has_owner) && !has_owner;
  const bool may_be_lost = std::exchange(may_be_lost_, false) || !schedule_.standstills.empty();
  if (!lost || may_be_lost || !is_in_time()) return;
  violate(fmt::format("kept: the link was lost {} us after a heartbeat that has to feed",
                      now_us_ - good_us_));
}

}  // namespace r4::simulation
