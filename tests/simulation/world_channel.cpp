// SPDX-License-Identifier: GPL-3.0-or-later
// The channel: loses, doubles, delays, damages and cuts.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "protocol/messages/command_field.hpp"
#include "world_host.hpp"

namespace r4::simulation {

void World::transfer(bool to_board, int host, std::uint32_t peer, std::string_view bytes) {
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
  if (to_board && read_datagram(Text(bytes), datagram)) {
    heartbeat = kind_of(datagram) == MessageKind::host_heartbeat;
    pnum = datagram.pnum();
    if (heartbeat) hosts_[static_cast<std::size_t>(host)]->heartbeat_pnum = pnum;
    if (asks_to_stop(datagram)) hosts_[static_cast<std::size_t>(host)]->stop_pnum = pnum;
    Command parsed;
    if (datagram.command_count() >= 1 &&
        parse_command(datagram.command(), parsed) == Refusal::none &&
        parsed.kind == CommandKind::stepper) {
      command = parsed.value;
      Sent& sent = commands_[static_cast<std::size_t>(command)];
      sent.transmitted_us = now_us_;
      if (sent.group && datagram.command_count() == 1 && !std::exchange(sent.apart, true)) {
        ++report_.groups_apart;
      }
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
    packet.peer = peer;
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
      packet.intact = read_datagram(Text(packet.bytes), changed) &&
                      packet.bytes.compare(0, content + 1, bytes, 0, content + 1) == 0;
    }
    std::uint64_t delay = faults.delay_us + random_.below(faults.jitter_us + 1);
    if (random_.chance(faults.straggle)) delay += random_.below(faults.straggle_us + 1);
    at(now_us_ + delay, Event::Kind::packet, slot);
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
  // Receiving may transfer, and so move packets_: take the packet out first.
  Packet packet = std::move(packets_[static_cast<std::size_t>(slot)]);
  if (packet.to_board) {
    if (keep_trace_) show(fmt::format("board receives {}", packet.bytes));
    const std::uint32_t peer = packet.peer;
    const std::uint32_t fed_before = board_->link().fed_ms();
    delivering_ = {packet.host, packet.incarnation};
    delivering_peer_ = peer;
    on_lease(peer, packet.bytes);
    board_->receive(0, peer, Text(packet.bytes), board_ms());
    if (packet.command >= 0) check_whole(packet.command);
    attacker_.on_received(packet.host, packet.bytes);
    const BoardLink& link = board_->link();
    if (asks_to_watch(packet.bytes) && link.fed_ms() != fed_before) violate("watch: a W feeds");
    if (packet.intact && packet.heartbeat && link.owner().peer == peer &&
        link.fed_ms() != fed_before) {
      fed_.push_back({delivering_, packet.pnum, packet.arrived_us});
      report_.waited_to_feed += packet.arrived_us != now_us_;
    }
  } else {
    Host& host = *hosts_[static_cast<std::size_t>(packet.host)];
    if (host.alive && host.peer == packet.peer) {
      host.session->receive(0, packet.bytes, host.time());
      poll_host(packet.host);
    }
  }
  packets_[static_cast<std::size_t>(slot)] = std::move(packet);
  release(slot);
}

void World::release(int slot) { free_packets_.push_back(slot); }

}  // namespace r4::simulation
