// SPDX-License-Identifier: GPL-3.0-or-later
// A host of the link simulator: the shipped session, and an application that sends commands.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <map>
#include <memory>
#include <string_view>
#include <vector>

#include "script.hpp"
#include "tests/support/driven_session.hpp"
#include "tests/support/signing.hpp"
#include "world.hpp"

namespace r4::simulation {

inline Key key_of_host(int index) { return test::key_of(static_cast<std::uint8_t>(index + 1)); }

struct World::Host final : test::DrivenSession::Handler {
  Host(World& w, int i) : world(w), index(i) {}

  void begin() {
    began_as = ++incarnation;
    alive = true;
    clock_offset_us = world.random_.below(1'000'000'000);
    leaving = false;
    stops.clear();
    clear_ticket = farewell_ticket = 0;
    SessionOptions options;
    options.arming = Arming::off;  // so that more commands are sent that must not be executed
    if (watcher) options.watch_rate_hz = static_cast<int>(world.random_.between(1, 100));
    if (world.script_ != nullptr) world.script_->set(options);
    if (world.has_keys() && !stopper && !watcher) {
      options.key = key_of_host(index);
      options.clock_start = std::chrono::hours{24} - Time{clock_offset_us};
    }
    session = std::make_unique<test::DrivenSession>(
        *this, options, watcher ? BoardRole::watch : BoardRole::control, places.size(),
        [this] { return world.random_.next(); });
    for (std::size_t i = 0; i < places.size(); ++i) {
      const Path& path = world.paths_[places[i].path];
      session->on_transport(i, world.now_us_ >= path.unplugged_until_us, time());
    }
    tickets.clear();
  }
  void die() {
    count_copies();
    alive = false;
    died_us = world.now_us_;
    session.reset();
  }
  void count_copies() {
    for (std::size_t i = 0; i < places.size(); ++i) {
      world.report_.copies += session->path(i, time()).copies;
    }
  }
  Time time() const { return Time{static_cast<std::int64_t>(world.now_us_ + clock_offset_us)}; }

  SendResult transmit(std::size_t path, std::string_view bytes, Priority priority) override {
    Datagram datagram;
    if (priority == Priority::stop && read_datagram(Text(bytes), datagram))
      stop_pnum = datagram.pnum();
    // A host that is the same peer as the host in control sends only stops (docs/reference/can.md).
    if (stopper && world.schedule_.shared_place && priority != Priority::stop) {
      return SendResult::busy;
    }
    if (world.now_us_ < world.paths_[places[path].path].unplugged_until_us) return SendResult::down;
    world.transfer(true, index, static_cast<int>(path), bytes);
    return SendResult::sent;
  }
  void on_state(const ReceivedState& state, const Datagram&) override {
    world.report_.watched += watcher;
    look_at_clock(state);
  }
  // Checks that the reported sampling time is right within its reported error.
  void look_at_clock(const ReceivedState& state) {
    if (state.sampled_error == ReceivedState::unknown) return;
    const auto age_ms = static_cast<std::int32_t>(world.board_ms() - state.t_ms);
    const auto since_boot_ms = static_cast<std::int32_t>(state.t_ms - world.boot_offset_ms_);
    if (age_ms < 0 || age_ms > 60'000 || since_boot_ms < 0)
      return;  // a state of an earlier boot, with another clock
    const Time truth{
        static_cast<std::int64_t>(world.when_board_shows(state.t_ms) + clock_offset_us)};
    const Time off = std::chrono::round<Time>(state.sampled.time_since_epoch()) - truth;
    ++world.report_.sampled;
    if (std::chrono::abs(off) <= state.sampled_error) return;
    ++world.report_.sampled_wrongly;
    world.note(fmt::format("host {} sample of T {} is timed {} us off, with an error of {} us",
                           index, state.t_ms, off.count(), state.sampled_error.count()));
  }
  void on_board_heartbeat(const Datagram&) override {}
  void on_identity(const Identity&) override {}
  void on_nack(const Nack&, const Datagram&) override {}
  void on_bad_datagram(const ReadResult&, std::string_view) override {}
  void on_link(const LinkStatus& status) override {
    world.note(fmt::format("host {} link {} safe {} busy {}", index, r4::to_text(status.state),
                           r4::to_text(status.reason), status.causes.has(LinkCause::busy)));
  }
  void on_result(Ticket ticket, const CommandResult& result) override;

  World& world;
  int index;
  std::uint32_t incarnation = 0;
  std::uint32_t began_as = 0;  // incarnation when this process began; a sleep also ends it
  bool alive = false;
  bool frozen = false;
  bool suspended = false;  // the process does not run
  bool stopper = false;
  bool watcher = false;
  bool leaving = false;  // ends at its next turn, after its confirmed stop or its farewell
  struct Place {
    int path = 0;
    std::uint32_t peer = 0;        // its address on this path
    std::uint32_t other_peer = 0;  // an earlier or later address; 0: none yet
  };
  std::vector<Place> places;  // the paths of its session
  // nullptr if the host is not on this path.
  const Place* on(int path) const {
    for (const Place& each : places) {
      if (each.path == path) return &each;
    }
    return nullptr;
  }
  std::uint64_t died_us = 0;
  std::uint64_t clock_offset_us = 0;
  std::uint64_t next_poll_us = 0;
  std::uint32_t poll_generation = 0;
  std::unique_ptr<test::DrivenSession> session;
  std::map<Ticket, int> tickets;
  struct Stop {
    std::uint32_t pnum = 0;
    bool executed = false;
  };
  std::map<Ticket, Stop> stops;
  std::uint32_t stop_pnum = 0;  // number of the newest stop sent
  std::uint32_t next_pnum = 0;  // number of the next datagram
  Ticket clear_ticket = 0;      // 0: no E:CLEAR is under way
  Ticket farewell_ticket = 0;
};

}  // namespace r4::simulation
