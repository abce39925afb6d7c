// SPDX-License-Identifier: GPL-3.0-or-later
// Programs that watch the board, a program that requests leases in the name of other programs, and
// the promise about the receivers of the board's states.
#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "protocol/messages/command_field.hpp"
#include "protocol/messages/state_fields.hpp"
#include "tests/support/datagrams.hpp"
#include "world_host.hpp"

namespace r4::simulation {

namespace {

constexpr std::uint64_t lease_us = 2'000'000;
constexpr std::uint64_t slack_us = 25'000;  // until the board checks again
constexpr std::uint32_t bystander = 0xFFFE;

}  // namespace

World::Host& World::watcher(int number) {
  return *hosts_[static_cast<std::size_t>(schedule_.hosts) + 1 + static_cast<std::size_t>(number)];
}

// Some watchers share a host's peer, as on a bus.
void World::add_watchers() {
  for (int i = 0; i < schedule_.watchers; ++i) {
    hosts_.push_back(std::make_unique<Host>(*this, schedule_.hosts + 1 + i));
    hosts_.back()->watcher = true;
    place(*hosts_.back());
  }
  if (schedule_.forge_interval_us != 0) at(start_us_, Event::Kind::forge, 0);
}

void World::watch(Host& watcher, bool over) {
  if (!over) {
    if (!watcher.alive) start_host(watcher.index);
    return;
  }
  if (!watcher.alive) return;
  if (random_.chance(0.5)) watcher.session->leave(Time{100'000}, watcher.time());
  watcher.die();
}

// The forger has the board's clock, and the tokens that were sent to other peers.
void World::forge_lease() {
  at(now_us_ + random_.between(1, 2ULL * schedule_.forge_interval_us), Event::Kind::forge, 0);
  if (standing_) return;
  const std::uint32_t own_address = 0xFFFF;
  std::uint32_t victim = random_.chance(0.3) ? own_address : bystander;
  if (random_.chance(0.5)) {
    const Host::Place* const place = hosts_[random_.below(hosts_.size())]->on(0);
    if (place != nullptr) victim = place->peer;
  }
  std::uint32_t echo = 0;
  auto pnum = static_cast<std::uint32_t>(random_.next());
  switch (random_.below(6)) {
    case 0:
      break;
    case 1:
      echo = board_ms();
      break;
    case 2:
      echo = board_ms() - static_cast<std::uint32_t>(random_.below(200));
      break;
    case 3:
      echo = newest_token_ + (random_.chance(0.5) ? 1U : 0U);
      break;
    case 4:  // an echo that would keep the link of the host in control
      victim = hosts_.front()->on(0)->peer;
      echo = stranger_.echo();
      pnum = hosts_.front()->next_pnum;
      break;
    default:
      for (const auto& [peer, lease] : leases_) {
        if (peer != victim && lease.token != 0 && random_.chance(0.5)) echo = lease.token;
      }
      break;
  }
  if (leases_[victim].tokens_us.contains(echo)) return;  // the forger cannot have this token
  ++report_.forged_leases;
  const std::string bytes =
      test::with_crc(fmt::format("W:{};PNum:{};T:{};", random_.below(1001), pnum, echo));
  note(fmt::format("forged from {}: {}", victim, bytes));
  delivering_ = {-1, 0};
  const std::uint32_t fed_ms = board_->link().fed_ms();
  board_->receive(0, victim, Text(bytes), board_ms());
  if (board_->link().fed_ms() != fed_ms) violate("watch: a W feeds");
}

bool World::asks_to_watch(std::string_view bytes) {
  Datagram datagram;
  return read_datagram(Text(bytes), datagram) && r4::asks_to_watch(datagram);
}

void World::on_told(std::uint32_t peer, const Datagram& datagram) {
  Nack nack;
  if (!read_nack(datagram, nack) || nack.lease == 0) return;
  leases_[peer].tokens_us[nack.lease] = now_us_;
  newest_token_ = nack.lease;
}

// Records a W that may begin or renew a lease at the board.
void World::on_lease(std::uint32_t peer, std::string_view bytes) {
  Datagram datagram;
  if (schedule_.watchers == 0 || !read_datagram(Text(bytes), datagram)) return;
  Command command;
  if (!r4::asks_to_watch(datagram) || parse_command(datagram.command(), command) != Refusal::none)
    return;
  Lease& lease = leases_[peer];
  const auto token = lease.tokens_us.find(static_cast<std::uint32_t>(datagram.time_ms()));
  const std::uint64_t limit_us = lease_us + slack_us;
  const bool good = token != lease.tokens_us.end() && now_us_ - token->second <= limit_us;
  if (!good || command.value == 0) return;
  report_.leases += lease.token == 0 || now_us_ - lease.renewed_us > limit_us;
  lease.token = token->first;
  lease.renewed_us = token->second = now_us_;
}

void World::check_stream(std::uint8_t port, std::uint32_t peer, const Datagram& datagram) {
  const BoardLink& link = board_->link();
  State state;
  read_state(datagram, state);
  if (!link.has_owner() && state.safe == SafeReason::none) {
    violate("watch: a state tells nothing of being safe, and there is no host");
  }
  if (link.has_owner() && board_->paths().has(Source{port, peer})) {
    // A session that begins at the time of a state gets a state immediately.
    const Streamed now{now_us_, fed_.size()};
    Streamed& before = owner_streamed_[{port, peer}];
    const bool twice = before == now && schedule_.standstills.empty();
    if (twice) violate("watch: the host in control is sent a state twice");
    before = now;
    return;
  }
  if (link.has_owner() && peer == everyone) return;  // sent on another port
  if (streamed_us_ != now_us_) streamed_.clear();
  streamed_us_ = now_us_;
  streamed_.insert(peer);
  // After a standstill a board runs several turns at once, and the receivers may change meanwhile.
  if (streamed_.size() > 4 && now_us_ != went_on_us_)
    violate("watch: states go to more than four places");
  const auto lease = leases_.find(peer);
  if (lease == leases_.end() || lease->second.token == 0) {
    return violate(fmt::format("watch: a state went to place {}, which has echoed nothing", peer));
  }
  const std::uint64_t since_us = now_us_ - lease->second.renewed_us;
  if (since_us > lease_us + slack_us) {
    violate(fmt::format("watch: a state went to place {} {} us after it renewed", peer, since_us));
  }
}

}  // namespace r4::simulation
