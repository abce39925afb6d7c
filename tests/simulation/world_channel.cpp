// SPDX-License-Identifier: GPL-3.0-or-later
// The channel: it loses, duplicates, delays, damages and cuts.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "protocol/messages/command_field.hpp"
#include "script.hpp"
#include "world_host.hpp"

namespace r4::simulation {

int World::take_slot() {
  if (free_packets_.empty()) {
    packets_.emplace_back();
    return static_cast<int>(packets_.size()) - 1;
  }
  const int slot = free_packets_.back();
  free_packets_.pop_back();
  return slot;
}

// Determines the kind of datagram that a host sent.
void World::describe(Packet& packet) {
  Datagram datagram;
  if (!read_datagram(Text(packet.bytes), datagram)) return;
  packet.heartbeat = kind_of(datagram) == MessageKind::host_heartbeat;
  packet.stop = asks_to_stop(datagram);
  packet.pnum = datagram.pnum();
  packet.t = datagram.time_ms();
  packet.sid = datagram.session_id();
  packet.command_count = datagram.command_count();
  Command command;
  if (packet.command_count >= 1 && parse_command(datagram.command(), command) == Refusal::none &&
      command.kind == CommandKind::stepper) {
    packet.command = command.value;
  }
}

void World::transfer(bool to_board, int host, int place, std::string_view bytes) {
  const Host::Place at_host =
      hosts_[static_cast<std::size_t>(host)]->places[static_cast<std::size_t>(place)];
  const std::uint32_t incarnation = hosts_[static_cast<std::size_t>(host)]->incarnation;
  if (recording_ && at_host.path == schedule_.replaying_path) {
    recorded_.push_back({now_us_, to_board, std::string(bytes)});
  }
  if (to_board) {
    if (has_keys()) attacker_.on_sent({host, incarnation, now_us_}, bytes);
  } else {
    if (has_keys()) attacker_.on_board(bytes);
    const bool busy = bytes.find(",BUSY;") != std::string_view::npos;
    if (host == 0 && busy) paths_[at_host.path].told_busy_us = now_us_;
  }
  mix(bytes.data(), bytes.size());
  if (keep_trace_) {
    const std::string over = several() ? fmt::format(" over {}", at_host.path) : "";
    show(fmt::format("{} host {}{} {}", to_board ? "->" : "<-", host, over, bytes));
  }
  const ChannelFaults& faults = schedule_.faults(at_host.path, to_board);
  Packet sent;
  sent.to_board = to_board;
  sent.host = host;
  sent.place = place;
  sent.port = port_of(at_host.path);
  sent.peer = at_host.peer;
  sent.incarnation = incarnation;
  sent.sent_us = now_us_;
  sent.bytes = bytes;
  if (to_board) describe(sent);
  if (to_board) hosts_[static_cast<std::size_t>(host)]->next_pnum = sent.pnum + 1;
  if (sent.command >= 0) {
    Sent& command = commands_[static_cast<std::size_t>(sent.command)];
    command.transmitted_us = now_us_;
    if (command.group && sent.command_count == 1 && !std::exchange(command.apart, true)) {
      ++report_.groups_apart;
    }
  }
  if (script_ != nullptr) return script_->on_sent(sent);
  const Path& path = paths_[at_host.path];
  if (now_us_ < (to_board ? path.cut_to_board_until_us : path.cut_to_host_until_us)) return;
  const int copies = 1 + (random_.chance(faults.duplicate) ? 1 : 0);
  for (int i = 0; i < copies; ++i) {
    if (random_.chance(faults.loss)) continue;
    const int slot = take_slot();
    Packet& packet = packets_[static_cast<std::size_t>(slot)];
    packet = sent;
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
      // If only the case of a checksum digit changed, the datagram is intact.
      Datagram changed;
      const std::size_t content = bytes.find('^');
      packet.intact = read_datagram(Text(packet.bytes), changed) &&
                      packet.bytes.compare(0, content + 1, bytes, 0, content + 1) == 0;
    }
    std::uint64_t delay = faults.delay_us + random_.below(faults.jitter_us + 1);
    if (random_.chance(faults.straggle)) delay += random_.below(faults.straggle_us + 1);
    at(std::max(now_us_, path.stalled_until_us) + delay, Event::Kind::packet, slot);
  }
}

void World::deliver(int slot) {
  Packet& packet = packets_[static_cast<std::size_t>(slot)];
  mix(packet.bytes.data(), packet.bytes.size());
  packet.arrived_us = now_us_;
  if (packet.to_board && packet.intact && packet.heartbeat) {
    heartbeat_in_us_ = heard_us_[packet.peer] = now_us_;
    heartbeat_sent_us_ = std::max(heartbeat_sent_us_, packet.sent_us);
  }
  if (packet.to_board && standing_) {
    waiting_.push_back(slot);
  } else {
    hand_over(slot);
  }
}

void World::hand_over(int slot) {
  // Move the packet out first: receiving may send datagrams, which may move packets_.
  Packet packet = std::move(packets_[static_cast<std::size_t>(slot)]);
  if (script_ != nullptr && script_->takes(packet)) {
    // A bridge has the packet, or a host that does not run keeps it.
  } else if (packet.to_board) {
    if (keep_trace_) show(fmt::format("board receives {}", packet.bytes));
    const std::uint32_t peer = packet.peer;
    const Source source{packet.port, peer};
    const std::uint32_t fed_before = board_->link().fed_ms();
    const bool had_owner = board_->link().has_owner();
    const bool lasts = had_owner && is_in_time() && schedule_.standstills.empty();
    delivering_ = {packet.host, packet.incarnation};
    delivering_at_ = source;
    on_lease(peer, packet.bytes);
    const bool has_to_feed_now = has_to_feed(packet);
    if (has_to_feed_now) good_us_ = now_us_;
    if (script_ != nullptr) script_->before_board(packet);
    board_->receive(packet.port, peer, Text(packet.bytes), board_ms());
    if (packet.command >= 0) check_whole(packet.command);
    if (script_ != nullptr) script_->after_board(packet);
    if (has_keys())
      attacker_.on_received({packet.host, packet.incarnation, packet.sent_us}, packet.bytes);
    const BoardLink& link = board_->link();
    if (asks_to_watch(packet.bytes) && link.fed_ms() != fed_before) violate("watch: a W feeds");
    if (packet.recorded && link.fed_ms() != fed_before) violate("joined: a recorded one feeds");
    const bool begins = link.has_owner() && !had_owner;
    if (packet.intact && packet.heartbeat &&
        (begins || has_to_feed_now || link.fed_ms() != fed_before)) {
      if (lasts && script_ == nullptr && fed_.back().from != delivering_) {
        violate("joined: a process keeps the session of another");
      }
      good_us_ = now_us_;
      fed_.push_back({delivering_, packet.pnum, packet.arrived_us, {source, packet.sid}});
      report_.waited_to_feed += packet.arrived_us != now_us_;
    }
  } else {
    Host& host = *hosts_[static_cast<std::size_t>(packet.host)];
    const Host::Place& place = host.places[static_cast<std::size_t>(packet.place)];
    const bool plugged = now_us_ >= paths_[place.path].unplugged_until_us;
    if (host.alive && plugged && place.peer == packet.peer) {
      if (several() && packet.host == 0 && packet.intact && !packet.recorded &&
          packet.sent_us > boot_us_) {
        on_told_state(place.path, packet.bytes);
      }
      host.session->receive(static_cast<std::size_t>(packet.place), packet.bytes, host.time());
      poll_host(packet.host);
    }
  }
  packets_[static_cast<std::size_t>(slot)] = std::move(packet);
  release(slot);
}

void World::release(int slot) { free_packets_.push_back(slot); }

}  // namespace r4::simulation
