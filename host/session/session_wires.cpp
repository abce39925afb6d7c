// SPDX-License-Identifier: GPL-3.0-or-later
// What a session does where several wires lead to its board, and what it tells of them.
#include <algorithm>
#include <array>

#include "../../protocol/messages/command_field.hpp"
#include "session.hpp"

namespace r4 {

const char* to_text(WireState state) {
  switch (state) {
    case WireState::down:
      return "down";
    case WireState::asking:
      return "asking";
    case WireState::other_board:
      return "other board";
    case WireState::silent:
      return "silent";
    case WireState::carrying:
      return "carrying";
  }
  return "unknown";
}

// --- what goes out

// A stop goes to all of them, whoever is there; anything else to those whose board is known.
SendResult Session::send_over(DatagramWriter& writer, Way way, Priority priority, Time now) {
  const bool stop = way.kind == CommandKind::stop;
  const WireSet to = stop ? way.wires : static_cast<WireSet>(way.wires & wires_.speaking());
  SendResult best = SendResult::down;
  bool busy = false;
  for (std::size_t i = 0; i < wires_.count(); ++i) {
    if ((to & wire_bit(i)) == 0) continue;
    const SendResult result = transmit_over(i, writer, priority, now);
    if (result == SendResult::sent && way.kind == CommandKind::identify) {
      wires_.asked(i, way.pnum, now);
    }
    if (result == SendResult::busy) {
      wires_.on_busy(i, state_.t_ms, now);
      busy = true;
    }
    if (result == SendResult::sent || best == SendResult::down) best = result;
  }
  if (busy && best != SendResult::sent && wires_.all_busy(now)) {
    role_.on_busy_until(wires_.all_busy_until(now));
  }
  return best;
}

// Are heartbeats, leases and commands sent on it?
bool Session::may_speak(std::size_t wire) const {
  return !wires_.several() || (wires_.speaking() & wire_bit(wire)) != 0;
}

// One question to all that are to be asked who their board is.
void Session::ask_wires(Time now) {
  if (const WireSet due = wires_.to_ask(now); due != 0) {
    std::array<char, max_datagram> buffer;
    DatagramWriter writer(buffer.data(), buffer.size());
    write_command(writer, Command::identify());
    stamp(writer, CommandKind::identify, link_.take_pnum(), to_ms(now));
    for (std::size_t i = 0; i < wires_.count(); ++i) {
      if ((due & wire_bit(i)) == 0) continue;
      transmit_over(i, writer, Priority::normal, now);
      wires_.asked(i, link_.last_pnum(), now);
    }
  }
  if (wires_.poll(now)) link_.on_transport(true);  // the first heartbeat goes out at once
}

// --- what comes

// True if the board sent that T less than the timeout ago, by what is known of its clock.
bool Session::is_recent(std::uint32_t t_ms, Time now) const {
  const auto most = static_cast<std::int32_t>(options_.timing.timeout_ms);
  return link_.is_of_this_boot(t_ms, to_ms(now), to_ms(now), most);
}

// Is it of the session's board as it is now? A restart that it shows has been noticed then.
bool Session::admit(std::size_t wire, const Datagram& datagram, Time now) {
  const auto t_ms = static_cast<std::uint32_t>(datagram.time_ms());
  const bool fits =
      link_.is_of_this_boot(t_ms, to_ms(now), to_ms(now), HostLink::boot_tolerance_ms);
  Wires::Take take = Wires::Take::no;
  switch (kind_of(datagram)) {
    case MessageKind::nack: {
      Nack nack;
      const bool counts = read_nack(datagram, nack) && nack.has_session;
      take = wires_.on_answer(wire, datagram.pnum(), t_ms, fits, counts, now);
      break;
    }
    case MessageKind::board_heartbeat:
      if (is_connecting_heartbeat(datagram)) {
        take = wires_.on_connecting(wire, now);
        // One that comes late is no sign that the board has begun again: who has its heartbeats learns that by the
        // answer of its clock, for which the wire is asked now.
        if (link_.echo() != 0 && is_heard(link_.state()) && is_recent(link_.echo(), now)) {
          take = Wires::Take::no;
        }
        break;
      }
      [[fallthrough]];
    default:
      take = wires_.on_datagram(wire, datagram.pnum(), t_ms, fits, now);
      break;
  }
  if (take == Wires::Take::restarted) {
    link_.on_clock(t_ms, true, to_ms(now));
    notice_restart(now);
  }
  return take != Wires::Take::no && wires_.begun();
}

// An answer is told whoever waits for it; of several to one question the first counts.
bool Session::admit_identity(std::size_t wire, const Datagram& datagram, const Identity& identity,
                             Time now) {
  const auto t_ms = static_cast<std::uint32_t>(datagram.time_ms());
  const bool fits =
      link_.is_of_this_boot(t_ms, to_ms(now), to_ms(now), HostLink::boot_tolerance_ms);
  const Wires::Answer answer = wires_.on_identity(wire, identity, t_ms, link_, now);
  if (answer == Wires::Answer::nothing || answer == Wires::Answer::other) return false;
  if (answer == Wires::Answer::restarted) link_.on_clock(t_ms, true, to_ms(now));
  notice_restart(now);
  wires_.on_answer(wire, datagram.pnum(), t_ms, fits, counts(identity), now);
  return true;
}

// The echo is the newest of all wires. A copy says nothing new.
bool Session::is_new_heartbeat(std::size_t wire, std::uint32_t t_ms) {
  const bool fresh = link_.echo() == 0 || newer(t_ms, link_.echo());
  fresh ? wires_.taken(wire) : wires_.copy(wire);
  return fresh;
}

// Or of the newest T, whose state may come in parts. What is older never replaces it.
bool Session::is_newest_state(std::size_t wire, const Datagram& datagram, Time now) {
  if (!admit(wire, datagram, now)) return false;
  const auto t_ms = static_cast<std::uint32_t>(datagram.time_ms());
  link_.on_heard(to_ms(now));
  wires_.lease(wire).on_state(now);
  if (!state_.any() || !newer(state_.t_ms, t_ms)) return true;
  wires_.copy(wire);
  return false;
}

// Does it bring any field that the states of this T have not brought?
bool Session::take_fields(std::size_t wire, const ReceivedState& fresh) {
  if (!state_.any() || fresh.t_ms != state_.t_ms) newest_fields_ = FieldSet();
  const FieldSet known = newest_fields_;
  newest_fields_.add(fresh.present);
  const bool copy = newest_fields_ == known;
  copy ? wires_.copy(wire) : wires_.taken(wire);
  return !copy;
}

// A state that is the newest one, though a heartbeat may have overtaken it.
Arrival Session::arrival_over(std::uint32_t t_ms, SafeReason reason, Time now) {
  return link_.on_newest(t_ms, false, reason, to_ms(now)) ? Arrival::next : Arrival::late;
}

// A copy of a command is answered, too: as the first one was, or as a duplicate of what was executed.
bool Session::is_told(const Nack& nack) {
  if (!wires_.several()) return false;
  if (nack.code == Refusal::duplicate) return true;
  for (const Answered& each : answered_) {
    if (each.pnum == nack.pnum && each.code == nack.code) return true;
  }
  answered_[answers_++ % answered_.size()] = {nack.pnum, nack.code};
  return false;
}

void Session::note_busy(std::size_t wire, std::uint32_t t_ms, Time now) {
  if (wires_.several()) {
    wires_.on_busy(wire, t_ms, now);
    if (wires_.all_busy(now)) role_.on_busy_until(wires_.all_busy_until(now));
  } else {
    role_.on_busy(now);
  }
}

// A state shows that the board has executed a command of ours in the session that it has.
void Session::note_own_command(Time now) {
  bool later = false;
  if (wires_.several()) {
    wires_.on_own_state(state_.t_ms, now);
    later = !wires_.all_busy(now);
  }
  role_.on_own_command(later, now);
}

// --- who watches

bool Session::streams(Time now) const {
  for (std::size_t i = 0; i < wires_.count(); ++i) {
    if (wires_.lease(i).streaming(now)) return true;
  }
  return false;
}

// What is wrong with all of them.
LeaseTrouble Session::lease_trouble(Time now) const {
  if (streams(now)) return LeaseTrouble::none;
  LeaseTrouble trouble = wires_.lease(0).trouble(now);
  for (std::size_t i = 1; i < wires_.count(); ++i) {
    trouble = std::max(trouble, wires_.lease(i).trouble(now));
  }
  return trouble;
}

Time Session::next_lease() const {
  Time next = Time::max();
  for (std::size_t i = 0; i < wires_.count(); ++i) {
    if (may_speak(i)) next = std::min(next, wires_.lease(i).next());
  }
  return next;
}

// --- what is told of them

WireState Session::wire_state(std::size_t wire) const {
  if (wires_.several()) return wires_.state(wire);
  if (transport_down_) return WireState::down;
  return is_heard(link_.state()) ? WireState::carrying : WireState::silent;
}

Wire Session::wire(std::size_t wire, Time now) const {
  const auto microseconds = [](Time time) { return static_cast<double>(time.count()); };
  const Time heard = wires_.heard_at(wire);
  Wire report;
  report.state = wire_state(wire);
  report.age_us = heard.count() != 0 ? microseconds(now - heard) : 0;
  if (!wires_.several()) {
    report.busy = role_.refused(now);
    report.packets = link_.counters();
    report.round_trip_us = collector_.counts.round_trip_us;
    return report;
  }
  report.busy = wires_.busy(wire, now);
  report.board_id = wires_.board_id(wire);
  report.packets = wires_.packets(wire);
  report.copies = wires_.copies(wire);
  report.round_trip_us = microseconds(wires_.round_trip(wire));
  return report;
}

}  // namespace r4
