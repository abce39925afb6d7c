// SPDX-License-Identifier: GPL-3.0-or-later
// The datagrams that a stranger sends and receives.
#include <fmt/format.h>

#include "play.hpp"
#include "tests/simulation/world_host.hpp"
#include "tests/support/datagrams.hpp"

namespace r4::simulation {
namespace {

constexpr std::uint64_t lease_us = 500'000;
constexpr std::uint64_t campaign_us = 100'000;

}  // namespace

// The stranger watches the board on the last path.
void Play::renew_lease() {
  if (!any_stranger_) return;
  const std::uint8_t port = world_.port_of(story_.paths - 1);
  say(fmt::format("W:5;PNum:{};T:{};", ++stranger_pnum_, stranger_.lease()), port,
      Stranger::address);
  after(stranger_.lease() == 0 ? 10'000 : lease_us, [this] { renew_lease(); });
}

bool Play::on_board_sent(std::uint8_t port, std::uint32_t peer, Priority, std::string_view bytes) {
  if (bridge_) {
    after(bridge_us, [this, text = std::string(bytes)] {
      if (keep_trace_) world_.show("bridge hears " + text);
      bridge_->board->say_bytes(text);
      carry_from_bridge(nullptr);
    });
    return true;
  }
  const bool told =
      peer == Stranger::address || (peer == everyone && port == world_.port_of(story_.paths - 1));
  if (any_stranger_ && told) stranger_.hears(bytes);
  return false;
}

void Play::say(const std::string& fields, std::uint8_t port, std::uint32_t peer) {
  say_bytes(test::with_crc(fields), port, peer);
}

void Play::say_bytes(std::string bytes, std::uint8_t port, std::uint32_t peer) {
  Packet packet;
  packet.to_board = true;
  packet.host = stranger_host;
  packet.port = port;
  packet.peer = peer;
  packet.sent_us = world_.now_us_;
  packet.bytes = std::move(bytes);
  world_.describe(packet);
  if (keep_trace_) world_.show(fmt::format("-> stranger at {}/{} {}", port, peer, packet.bytes));
  deliver_in(delay_us, packet);
}

std::uint32_t Play::next_number() const {
  const int whose = has_controller_ && controller_.host >= 0 ? controller_.host : 0;
  return stranger_.guess(world_.hosts_[static_cast<std::size_t>(whose)]->next_pnum);
}

void Play::say_once(Fault::Kind kind) {
  const std::uint8_t port = world_.port_of(story_.paths - 1);
  std::string field = "H:ROS2-R4";
  if (kind == Fault::Kind::stranger_drives) field = "P:-7777,1000,1";
  if (kind == Fault::Kind::stranger_leaves) field = "E:LEAVE";
  if (kind == Fault::Kind::stranger_clears) field = fmt::format("E:CLEAR,{}", stranger_.cause());
  say(fmt::format("{}{};PNum:{};T:{};", stranger_.name(), field, next_number(), stranger_.echo()),
      port, Stranger::address);
}

// Sends a duplicate of a host's datagram from the stranger's address.
void Play::repeat(const std::string& bytes, Process signer) {
  copied_.try_emplace(bytes, Signed{signer});
  say_bytes(bytes, world_.port_of(story_.paths - 1), Stranger::address);
}

// True if a running host has this address.
bool Play::is_taken(std::uint32_t peer) {
  for (const auto& each : world_.hosts_) {
    for (const Host::Place& place : each->places) {
      if (each->alive && place.peer == peer) return true;
    }
  }
  return false;
}

void Play::carry_on(Fault::Kind kind, std::uint8_t port, std::uint32_t peer) {
  after(campaign_us, [this, kind, port, peer] { carry_on(kind, port, peer); });
  if (kind == Fault::Kind::stranger_inherits && is_taken(peer)) return;
  const std::uint32_t echo = stranger_.echo();
  if (kind == Fault::Kind::stranger_is_paper) {
    const std::uint32_t clock = world_.board_ms() + 1'000'000;
    say(fmt::format("H:ROS2-R4;PNum:{};T:{};", ++stranger_pnum_, clock), port, peer);
    say(fmt::format("P:-7777,1000,1;PNum:{};T:{};", ++stranger_pnum_, clock), port, peer);
    return;
  }
  if (kind == Fault::Kind::stranger_competes) {
    // Alternates between its own SID and a paper host.
    const char* const own = stranger_pnum_ % 4 < 2 ? "" : Stranger::own_name;
    const std::uint32_t first = 0x9000'0000U;
    say(fmt::format("{}H:ROS2-R4;PNum:{};T:{};", own, first + ++stranger_pnum_, echo), port, peer);
    say(fmt::format("{}P:-7777,1000,1;PNum:{};T:{};", own, first + ++stranger_pnum_, echo), port,
        peer);
    return;
  }
  const std::string& name = stranger_.name();
  const std::uint32_t next = next_number();
  if (campaign_pnum_ == 0 || newer(next, campaign_pnum_)) campaign_pnum_ = next;
  say(fmt::format("{}H:ROS2-R4;PNum:{};T:{};", name, next, echo), port, peer);
  say(fmt::format("{}H:ROS2-R4;PNum:{};T:{};", name, ++campaign_pnum_, echo), port, peer);
  say(fmt::format("{}P:-7777,1000,1;PNum:{};T:{};", name, ++campaign_pnum_, echo), port, peer);
  say(fmt::format("{}H:ROS2-R4;PNum:{};T:0;", name, ++campaign_pnum_), port, peer);
}

}  // namespace r4::simulation
