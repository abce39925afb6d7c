// SPDX-License-Identifier: GPL-3.0-or-later
#include "bridged_pair.hpp"

#include <optional>
#include <utility>

#include "../../protocol/messages/command_field.hpp"
#include "../../protocol/messages/message.hpp"
#include "../../transports/file_descriptor.hpp"

namespace r4 {
namespace {

using std::chrono::milliseconds;

// A board that was silent for so long may have begun again, with another clock.
constexpr milliseconds clock_lifetime{1500};

std::string_view view(Text text) { return {text.data(), text.size()}; }

// As in firmware: a single command of another letter is no stop.
bool is_stop(const Datagram& datagram) {
  const bool may_be = datagram.command_count() != 1 || datagram.command().name() == "E";
  return may_be && asks_to_stop(datagram);
}

bool is_single(const Datagram& datagram, Text name) {
  return datagram.command_count() == 1 && datagram.command().name() == name;
}

bool is_absence(ErrorKind kind) {
  return kind == ErrorKind::open || kind == ErrorKind::unsupported || kind == ErrorKind::refused;
}

}  // namespace

BridgedPair::BridgedPair(Setup setup)
    : hosts_absence_(setup.hosts_absence),
      now_(std::move(setup.now)),
      on_event_(std::move(setup.on_event)),
      hosts_(*this, BridgeSide::hosts, std::move(setup.hosts)),
      board_(*this, BridgeSide::board, std::move(setup.board)),
      control_(setup.timeout) {}

// --- the two sides

void BridgedPair::open() {
  const Time now = now_();
  try_to_open(hosts_, hosts_absence_, now);
  try_to_open(board_, Absence::awaited, now);
}

void BridgedPair::close() noexcept {
  for (Side* const side : {&hosts_, &board_}) {
    side->opened = false;
    side->carrier->close();
  }
}

void BridgedPair::try_to_open(Side& side, Absence absence, Time now) {
  side.tried = now;
  side.waiting.begin(now);
  try {
    side.opened = true;  // it may be up before it returns
    with_system_errors(side.carrier->name(), [&] { side.carrier->open(side); });
  } catch (const Error& error) {
    side.opened = false;
    if (absence == Absence::refused || !is_absence(error.kind())) throw;
    if (side.obstacle == error.what()) return;
    side.obstacle = error.what();
    side.on_carrier_event({CarrierEvent::Kind::down, error.problem()});
  }
}

void BridgedPair::tick() {
  const Time now = now_();
  for (Side* const side : {&hosts_, &board_}) {
    if (side->opened) {
      side->waiting.on_tick(now);
    } else if (now - side->tried >= try_again) {
      try {
        try_to_open(*side, Absence::awaited, now);
      } catch (const Error& error) {  // it is there, and cannot be had
        if (std::exchange(side->obstacle, error.what()) != error.what()) {
          side->on_carrier_event({CarrierEvent::Kind::down, error.problem()});
        }
      }
    }
  }
}

void BridgedPair::Side::on_carrier_event(const CarrierEvent& event) {
  if (event.kind == CarrierEvent::Kind::up) obstacle.clear();
  if (pair.on_event_) pair.on_event_(which, event);
}

BridgeStatus BridgedPair::status() const {
  BridgeStatus status;
  const auto fill = [](const Side& side, const Side& other, BridgeEnd& out) {
    out.name = side.carrier->name();
    out.up = side.opened && side.carrier->up();
    out.from = side.counters;
    out.from.outdated = other.carrier->counters().tx_dropped - other.refused;
  };
  fill(hosts_, board_, status.hosts);
  fill(board_, hosts_, status.board);
  return status;
}

// --- what passes

void BridgedPair::Side::on_datagram(std::string_view bytes, Peer from) {
  Datagram datagram;
  if (!read_datagram(Text(bytes.data(), bytes.size()), datagram)) {
    ++counters.damaged;
    return;
  }
  const Time now = pair.now_();
  if (which == BridgeSide::hosts) {
    pair.on_host_datagram(datagram, from, now);
  } else {
    pair.on_board_datagram(datagram, now);
  }
}

bool BridgedPair::is_old(Side& side, Time now) {
  if (side.waiting.at_most(now) <= oldest) return false;
  ++side.counters.late;
  return true;
}

void BridgedPair::on_host_datagram(const Datagram& datagram, Peer from, Time now) {
  const MessageKind kind = kind_of(datagram);
  if (kind == MessageKind::command && is_stop(datagram)) {
    if (!control_.has_place(from)) audience_.on_stop(from, now);
    return pass_on(datagram, Priority::stop);
  }
  if (is_old(hosts_, now)) return;
  if (kind == MessageKind::command) return on_command(datagram, from, now);
  if (kind != MessageKind::host_heartbeat) {
    ++hosts_.counters.misdirected;
    return;
  }
  const std::optional<Peer> before = control_.host();
  if (!control_.on_heartbeat(from, now)) {
    ++hosts_.counters.kept_out;
    return answer(datagram, Refusal::busy, 0, from, now);  // as the board does
  }
  if (before != control_.host()) hosts_.carrier->hold(from);
  pass_on(datagram);
}

void BridgedPair::on_command(const Datagram& datagram, Peer from, Time now) {
  if (is_single(datagram, Text("W"))) return on_lease(datagram, from, now);
  const bool has_place = control_.has_place(from);
  if (is_single(datagram, Text("Q"))) {
    if (!has_place && datagram.has_pnum()) audience_.on_question(from, datagram.pnum(), now);
    return pass_on(datagram);
  }
  if (!has_place) {
    ++hosts_.counters.kept_out;
    // Where nobody keeps it out, its heartbeat comes.
    if (control_.keeps_out(from, now)) answer(datagram, Refusal::busy, 0, from, now);
    return;
  }
  const Field& command = datagram.command();
  if (is_single(datagram, Text("E")) && command.values() == "LEAVE") control_.on_farewell();
  pass_on(datagram);
}

// The board takes it for one of the host that has the place, and answers nothing while that is there.
void BridgedPair::on_lease(const Datagram& datagram, Peer from, Time now) {
  if (control_.has_place(from)) return pass_on(datagram);
  const bool ends = datagram.command().values() == "0";
  const auto effect = audience_.on_lease(from, ends, datagram.time_ms(), now);
  if (effect == BridgeAudience::Effect::full) return answer(datagram, Refusal::busy, 0, from, now);
  if (!control_.keeps_out(from, now)) {
    if (datagram.has_pnum()) audience_.on_question(from, datagram.pnum(), now);
    return pass_on(datagram);
  }
  ++hosts_.counters.kept_out;
  if (effect == BridgeAudience::Effect::watching) return;
  const std::uint32_t token = audience_.new_token();
  audience_.tell(from, token, now);
  answer(datagram, Refusal::stale, token, from, now);
}

void BridgedPair::on_board_datagram(const Datagram& datagram, Time now) {
  if (is_old(board_, now)) return;
  const MessageKind kind = kind_of(datagram);
  if (kind == MessageKind::command || kind == MessageKind::host_heartbeat) {
    ++board_.counters.misdirected;
    return;
  }
  if (datagram.has_pnum() && datagram.has_time()) {
    board_known_ = true;
    board_pnum_ = datagram.pnum();
    board_t_ = datagram.time_ms();
    board_heard_ = now;
  }
  std::optional<Peer> asker;
  switch (kind) {
    case MessageKind::nack: {
      Nack nack;
      if (read_nack(datagram, nack)) asker = audience_.asker_of(nack.pnum, now);
      if (asker && nack.lease != 0) audience_.tell(*asker, nack.lease, now);
      break;
    }
    case MessageKind::identity: {
      Identity identity;
      if (read_identity(datagram, identity) && identity.has_asked) {
        asker = audience_.asker_of(identity.asked, now);
      }
      break;
    }
    case MessageKind::board_heartbeat:
      if (is_connecting_heartbeat(datagram) || heartbeat_reason(datagram) == SafeReason::link) {
        control_.on_no_host();
      }
      break;
    default:
      control_.on_state(now);
      break;
  }
  const Priority priority = kind == MessageKind::state ? Priority::state : Priority::normal;
  if (asker) return deliver(board_, hosts_, datagram, priority, *asker);
  deliver(board_, hosts_, datagram, priority);
  if (audience_.empty() || kind == MessageKind::nack || kind == MessageKind::identity) return;
  const auto copy = [&](Peer peer) {
    if (!hosts_.carrier->reaches(peer)) send(hosts_, view(datagram.bytes()), priority, peer);
  };
  if (kind == MessageKind::state) return audience_.for_each_watcher(now, copy);
  audience_.for_each_listener(now, copy);
}

// In the board's place, as if it had said so together with what it said last.
void BridgedPair::answer(const Datagram& asked, Refusal code, std::uint32_t lease, Peer to,
                         Time now) {
  if (!asked.has_pnum() || !board_known_ || now - board_heard_ > clock_lifetime) return;
  Nack nack;
  nack.pnum = asked.pnum();
  nack.code = code;
  nack.lease = lease;
  std::array<char, 160> buffer;
  DatagramWriter writer(buffer.data(), buffer.size());
  write_nack(writer, nack);
  const auto since = std::chrono::duration_cast<milliseconds>(now - board_heard_).count();
  const Text text = writer.finish(board_pnum_, board_t_ + static_cast<std::uint64_t>(since));
  send(hosts_, view(text), Priority::normal, to);
}

void BridgedPair::deliver(Side& from, Side& to, const Datagram& datagram, Priority priority,
                          Peer peer) {
  if (!send(to, view(datagram.bytes()), priority, peer)) {
    ++from.counters.undelivered;
    return;
  }
  ++from.counters.passed;
  if (priority == Priority::stop) ++from.counters.stops;
}

bool BridgedPair::send(Side& to, std::string_view bytes, Priority priority, Peer peer) {
  if (!to.opened) return false;
  const std::uint64_t dropped = to.carrier->counters().tx_dropped;
  if (to.carrier->send(bytes, priority, peer) == SendResult::sent) return true;
  to.refused += to.carrier->counters().tx_dropped - dropped;
  return false;
}

}  // namespace r4
