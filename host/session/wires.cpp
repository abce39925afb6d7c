// SPDX-License-Identifier: GPL-3.0-or-later
#include "wires.hpp"

#include <algorithm>

namespace r4 {

// --- the transports

void Wires::on_transport(std::size_t index, bool up, bool can_ask, Time now) {
  Wire& wire = wires_[index];
  wire.up = up;
  wire.can_ask = can_ask;
  wire.known = up && !can_ask;
  wire.other = wire.connecting = wire.has_clock = false;
  wire.heard = wire.busy_until = Time{0};
  wire.ask_at = can_ask ? now : Time::max();
  if (wire.known && first_answer_.count() == 0) first_answer_ = now;
  anew_ = anew_ || all_down();
  // It may bring other numbers from now on.
  if (up && wire.tracker.started()) wire.tracker.restart();
  look(now);
}

bool Wires::all_down() const {
  return std::none_of(wires_.begin(), wires_.end(), [](const Wire& wire) { return wire.up; });
}

void Wires::on_sleep(Time now) {
  for (Wire& wire : wires_) {
    wire.has_clock = wire.connecting = false;
    wire.heard = wire.busy_until = Time{0};
    wire.question = IdentityQuestion{Time{0}};
    if (wire.up && wire.can_ask) wire.ask_at = now;
    if (wire.tracker.started()) wire.tracker.restart();
    wire.lease.renew(now);
  }
  anew_ = true;
  look(now);
}

// --- who is there

WireSet Wires::to_ask(Time now) const {
  WireSet due = 0;
  for (std::size_t i = 0; i < wires_.size(); ++i) {
    if (wires_[i].up && wires_[i].can_ask && now >= wires_[i].ask_at) due |= wire_bit(i);
  }
  return due;
}

void Wires::asked(std::size_t index, std::uint32_t pnum, Time now) {
  Wire& wire = wires_[index];
  wire.question.asked(pnum, now);
  wire.asked_at = now;
  const Time again = now + (wire.other ? ask_other_interval : ask_interval);
  wire.ask_at = wire.known ? Time::max() : again;
}

// A wire whose T does not fit.
void Wires::ask_soon(Wire& wire, Time now) {
  if (!wire.can_ask) return;
  wire.ask_at = std::min(wire.ask_at, std::max(now, wire.asked_at + ask_interval));
}

Wires::Answer Wires::on_identity(std::size_t index, const Identity& identity, std::uint32_t t_ms,
                                 const HostLink& link, Time now) {
  Wire& wire = wires_[index];
  const std::optional<Time> asked = wire.question.answered(identity);
  if (!wire.up || (!asked && wire.can_ask)) return Answer::nothing;
  const std::string_view id(identity.board_id.data(), identity.board_id.size());
  if (wire.board_id != id) wire.board_id = id;
  // The first board that answers, until the session begins: while no other wire leads to it, it may have been a mistake.
  if (!has_id_ || (!begun_ && (known() & ~wire_bit(index)) == 0)) {
    has_id_ = true;
    id_ = id;
  }
  wire.other = id_ != id;
  wire.known = !wire.other;
  if (wire.other) {
    wire.ask_at = wire.can_ask ? now + ask_other_interval : Time::max();
    look(now);
    return Answer::other;
  }
  wire.ask_at = Time::max();
  if (first_answer_.count() == 0) first_answer_ = now;
  if (!asked) return Answer::known;
  wire.round_trip = now - *asked;
  // Of two boots the later one is that which answered what was asked after the other had answered.
  const bool later = *asked > proven_;
  // The board has answered between the question and now, which tells boots apart that are close together.
  const bool fits = link.knows_clock() ? link.is_of_this_boot(t_ms, to_ms(*asked), to_ms(now),
                                                              HostLink::booting_tolerance_ms)
                                       : fits_others(wire, t_ms, now);
  if (!fits && !later) {
    ask_soon(wire, now);
    return Answer::known;
  }
  if (!fits) ++boot_;
  set_clock(wire, t_ms, now);
  wire.boot = boot_;
  proven_ = now;
  compare_those_that_listen(t_ms, now);
  return fits ? Answer::known : Answer::restarted;
}

bool Wires::two_boards() const {
  return std::any_of(wires_.begin(), wires_.end(), [](const Wire& wire) { return wire.other; });
}

WireSet Wires::known() const {
  WireSet set = 0;
  for (std::size_t i = 0; i < wires_.size(); ++i) {
    if (wires_[i].known) set |= wire_bit(i);
  }
  return set;
}

bool Wires::poll(Time now) {
  look(now);
  if (begun_ || known() == 0 || two_boards()) return false;
  const bool asking = std::any_of(wires_.begin(), wires_.end(), [](const Wire& wire) {
    const bool compared = wire.can_ask || wire.has_clock;
    return wire.up && !(wire.known && compared);
  });
  if (asking && now < first_answer_ + patience) return false;
  begun_ = true;
  return true;
}

Time Wires::next(Time now) const {
  Time next = Time::max();
  for (const Wire& wire : wires_) {
    if (wire.up && wire.can_ask) next = std::min(next, std::max(wire.ask_at, now + Time{1000}));
    if (is_heard(wire, now)) next = std::min(next, wire.heard + timeout_);
  }
  const Time begins = first_answer_ + patience;
  if (!begun_ && known() != 0 && begins > now) next = std::min(next, begins);
  return next;
}

// --- what comes

bool Wires::in_clock(const Wire& wire, std::uint32_t t_ms, Time now) {
  if (!wire.has_clock) return false;
  const std::uint32_t expected = wire.board_ms + (to_ms(now) - wire.clock_ms);
  const auto off = static_cast<std::int32_t>(t_ms - expected);
  const std::int32_t most =
      wire.connecting ? HostLink::booting_tolerance_ms : HostLink::boot_tolerance_ms;
  return off <= most && off >= -most;
}

// Before the link knows the board's clock, only the other wires do: of them one may have answered before a restart.
bool Wires::fits_others(const Wire& wire, std::uint32_t t_ms, Time now) const {
  return std::all_of(wires_.begin(), wires_.end(), [&](const Wire& each) {
    const bool knows = &each != &wire && each.known && each.has_clock && each.boot == boot_;
    return !knows || in_clock(each, t_ms, now);
  });
}

void Wires::set_clock(Wire& wire, std::uint32_t t_ms, Time now) {
  wire.has_clock = true;
  wire.board_ms = t_ms;
  wire.clock_ms = to_ms(now);
}

// Is what a wire brings that cannot be asked of the session's board, by its T? Before the session begins the other
// wires know its clock alone.
bool Wires::agrees(const Wire& wire, std::uint32_t t_ms, bool fits, Time now) const {
  return begun_ ? fits : fits_others(wire, t_ms, now);
}

// The board has said its T on a wire that was asked: those that cannot be asked, and had another, are of another
// board, or have yet to bring what is of this boot.
void Wires::compare_those_that_listen(std::uint32_t t_ms, Time now) {
  anew_ = false;
  for (Wire& each : wires_) {
    if (each.can_ask || !each.has_clock || in_clock(each, t_ms, now)) continue;
    each.has_clock = false;
    if (!begun_) turn_away(each, now);
  }
}

void Wires::turn_away(Wire& wire, Time now) {
  wire.other = true;
  wire.known = false;
  look(now);
}

// Is it of the board as the session knows it? If not, the wire is asked.
bool Wires::admits(Wire& wire, std::uint32_t t_ms, Time now) const {
  if (!wire.known) return false;
  if (wire.boot == boot_ && in_clock(wire, t_ms, now)) return true;
  ask_soon(wire, now);
  return false;
}

Wires::Take Wires::on_datagram(std::size_t index, std::uint32_t pnum, std::uint32_t t_ms, bool fits,
                               Time now) {
  Wire& wire = wires_[index];
  Take take = Take::yes;
  if (!admits(wire, t_ms, now)) {
    if (wire.can_ask || !wire.up) return Take::no;
    if (!agrees(wire, t_ms, fits, now)) {
      // A restart, if it has carried and no other one knows better.
      const bool carried = wire.has_clock && wire.boot == boot_;
      if (!carried && !anew_) turn_away(wire, now);
      if ((!carried && !anew_) || others_carry(wire, now)) return Take::no;
      ++boot_;
      proven_ = now;
      take = Take::restarted;
    }
    wire.other = false;
    wire.known = true;
    wire.boot = boot_;
  }
  anew_ = false;
  wire.connecting = false;
  set_clock(wire, t_ms, now);
  wire.heard = now;
  look(now);
  const std::uint32_t lost = wire.tracker.counters().lost;
  wire.gap = wire.tracker.on(pnum) == Arrival::gap ? wire.tracker.counters().lost - lost : 0;
  return take;
}

Wires::Take Wires::on_connecting(std::size_t index, Time now) {
  Wire& wire = wires_[index];
  if (!wire.known) return Take::no;
  wire.heard = now;
  look(now);
  if (!wire.connecting) {
    wire.connecting = true;
    if (wire.tracker.started()) wire.tracker.restart();
  }
  ask_soon(wire, now);  // what it sends next is of another clock
  return all_connecting(now) ? Take::connecting : Take::no;
}

Wires::Take Wires::on_answer(std::size_t index, std::uint32_t pnum, std::uint32_t t_ms, bool fits,
                             bool counts, Time now) {
  Wire& wire = wires_[index];
  if (!admits(wire, t_ms, now)) {
    // On a bus the states come only once a lease was answered.
    const bool first = !wire.can_ask && wire.known && !wire.has_clock;
    if (!first) return Take::no;
    if (!agrees(wire, t_ms, fits, now)) {
      if (!anew_) turn_away(wire, now);
      return Take::no;
    }
  }
  wire.heard = now;
  look(now);
  if (counts && wire.tracker.started()) wire.tracker.on(pnum);
  return Take::yes;
}

void Wires::taken(std::size_t index) {
  Wire& wire = wires_[index];
  ++counters_.received;
  if (wire.gap > wire.others) counters_.lost += wire.gap - wire.others;
  for (Wire& each : wires_) ++each.others;
  wire.others = 0;
}

void Wires::copy(std::size_t index) {
  Wire& wire = wires_[index];
  ++wire.copies;
  ++counters_.duplicate;
  wire.others -= std::min(wire.others, wire.gap + 1);
}

bool Wires::all_connecting(Time now) const {
  return std::all_of(wires_.begin(), wires_.end(),
                     [&](const Wire& wire) { return wire.connecting || !is_heard(wire, now); });
}

bool Wires::others_carry(const Wire& wire, Time now) const {
  return std::any_of(wires_.begin(), wires_.end(),
                     [&](const Wire& each) { return &each != &wire && is_heard(each, now); });
}

void Wires::on_busy(std::size_t index, std::uint32_t t_ms, Time now) {
  Wire& wire = wires_[index];
  wire.busy_until = now + busy_memory;
  wire.busy_ms = t_ms;
}

void Wires::on_own_state(std::uint32_t t_ms, Time now) {
  own_state_at_ = now;
  own_state_ms_ = t_ms;
}

bool Wires::refuses(const Wire& wire, Time now) const {
  if (now >= wire.busy_until) return false;
  const bool any = own_state_at_.count() != 0 && now - own_state_at_ < own_state_memory;
  return !any || newer(wire.busy_ms, own_state_ms_);
}

bool Wires::all_busy(Time now) const {
  return std::all_of(wires_.begin(), wires_.end(),
                     [&](const Wire& wire) { return refuses(wire, now) || !is_heard(wire, now); });
}

Time Wires::all_busy_until(Time now) const {
  Time until = now + busy_memory;
  for (const Wire& wire : wires_) {
    if (is_heard(wire, now)) until = std::min(until, wire.busy_until);
  }
  return until;
}

void Wires::look(Time now) {
  carrying_ = 0;
  for (std::size_t i = 0; i < wires_.size(); ++i) {
    if (is_heard(wires_[i], now)) carrying_ |= wire_bit(i);
  }
}

WireState Wires::state(std::size_t index) const {
  const Wire& wire = wires_[index];
  if (!wire.up) return WireState::down;
  if (wire.other) return WireState::other_board;
  if (!wire.known) return WireState::asking;
  return (carrying_ & wire_bit(index)) != 0 ? WireState::carrying : WireState::silent;
}

}  // namespace r4
