// SPDX-License-Identifier: GPL-3.0-or-later
#include "bridged_pair.hpp"

#include <algorithm>
#include <cstdlib>
#include <optional>
#include <utility>

#include "../../protocol/messages/command_field.hpp"
#include "../../protocol/messages/message.hpp"
#include "../../protocol/messages/site_settings.hpp"
#include "../../transports/file_descriptor.hpp"

namespace r4 {
namespace {

using std::chrono::milliseconds;

// After a longer silence the board may have restarted its clock.
constexpr milliseconds clock_lifetime{1500};

std::string_view view(Text text) { return {text.data(), text.size()}; }

// As in firmware: a single command of another letter is not a stop.
bool is_stop(const Datagram& datagram) {
  const bool may_be = datagram.command_count() != 1 || datagram.command().name() == "E";
  return may_be && asks_to_stop(datagram);
}

bool has_site_setting(const Datagram& datagram) {
  for (const Field& field : datagram) {
    if (field.name() != "C") continue;
    Text key;
    if (field.split(&key, 1) != 0 && is_site_setting(key)) return true;
  }
  return false;
}

// True if the error means an absence, such as an unplugged device, which may end by itself.
bool is_absence(ErrorKind kind) {
  return kind == ErrorKind::open || kind == ErrorKind::unsupported || kind == ErrorKind::refused;
}

}  // namespace

BridgedPair::BridgedPair(Setup setup)
    : now_(std::move(setup.now)),
      on_event_(std::move(setup.on_event)),
      hosts_(*this, BridgeSide::hosts, std::move(setup.hosts), setup.hosts_may_be_away),
      board_(*this, BridgeSide::board, std::move(setup.board), true),
      timeout_(setup.timeout),
      known_(setup.timeout),
      guard_(setup.keys, setup.trusted) {}

void BridgedPair::open() {
  const Time now = now_();
  try_to_open(hosts_, false, now);
  try_to_open(board_, false, now);
}

void BridgedPair::close() noexcept {
  for (Side* const side : {&hosts_, &board_}) {
    side->opened = false;
    side->carrier->close();
  }
}

void BridgedPair::try_to_open(Side& side, bool may_fail, Time now) {
  side.tried = now;
  side.waiting.begin(now);
  try {
    side.opened = true;  // open() may report `up` before it returns
    with_system_errors(side.carrier->name(), [&] { side.carrier->open(side); });
  } catch (const Error& error) {
    side.opened = false;
    if (!may_fail && !(side.may_be_away && is_absence(error.kind()))) throw;
    if (std::exchange(side.obstacle, error.what()) == error.what()) return;
    side.on_carrier_event({CarrierEvent::Kind::down, error.problem()});
  }
}

void BridgedPair::tick() {
  const Time now = now_();
  for (Side* const side : {&hosts_, &board_}) {
    if (side->opened) {
      side->waiting.on_tick(now);
    } else if (now - side->tried >= try_again) {
      try_to_open(*side, true, now);
    }
  }
  follow_hosts(now);
  watch_board(now);
}

void BridgedPair::Side::on_carrier_event(const CarrierEvent& event) {
  if (event.kind == CarrierEvent::Kind::up) obstacle.clear();
  if (event.kind == CarrierEvent::Kind::down && which == BridgeSide::board) {
    pair.guard_.on_board_gone();
  }
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

void BridgedPair::Side::on_datagram(std::string_view bytes, Peer from) {
  Datagram datagram;
  if (!read_datagram(bytes, datagram)) {
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
    audience_.listen(from, now);
    return deliver(hosts_, board_, datagram, Priority::stop);
  }
  if (is_old(hosts_, now)) return;
  if (kind == MessageKind::command) return on_command(datagram, from, now);
  if (kind != MessageKind::host_heartbeat) {
    ++hosts_.counters.misdirected;
    return;
  }
  if (!is_allowed(datagram, kind, from, now)) return;
  const SessionId sid = datagram.session_id();
  const bool trusted = known_.trusts(from, sid, now);
  if (!trusted && !may_ask(now)) return;
  if (!known_.on_heartbeat(from, datagram, is_judged(datagram), now)) {
    ++hosts_.counters.kept_out;
    return answer(datagram, Refusal::busy, 0, from, now);  // as the board does
  }
  // A host needs a heartbeat of the board for its echo.
  if (!trusted) audience_.listen(from, now);
  pass_on(datagram, from, trusted, now);
  follow_hosts(now);
}

void BridgedPair::on_command(const Datagram& datagram, Peer from, Time now) {
  if (asks_to_watch(datagram)) return on_lease(datagram, from, now);
  const SessionId sid = datagram.session_id();
  const bool trusted = known_.trusts(from, sid, now);
  const Field& command = datagram.command();
  const bool asks_who =
      datagram.command_count() == 1 && command.name() == "Q" && command.values() == "ID";
  if (!asks_who && !is_allowed(datagram, MessageKind::command, from, now)) return;
  if (!asks_who && !known_.knows(from, sid, now)) {
    ++hosts_.counters.kept_out;  // without an answer, because the host's heartbeats are answered
    return;
  }
  if (!trusted && !may_ask(now)) return;
  // The answer has SESSION, so it proves that the board does not execute the command: the
  // bridge passes no site setting to the board.
  if (has_site_setting(datagram)) {
    ++hosts_.counters.refused;
    return answer(datagram, Refusal::auth, 0, from, now, known_.first_heartbeat(from, sid));
  }
  // Without SID, the answer to Q:ID may be for a paper host or for a program without a session.
  pass_on(datagram, from, trusted && !(asks_who && sid == no_session), now);
}

bool BridgedPair::may_ask(Time now) {
  if (asking_.take(ms_of(now))) return true;
  ++hosts_.counters.kept_out;
  return false;
}

// True if the board begins or feeds a session by this heartbeat, or answers BUSY. The heartbeat of
// a session must echo a heartbeat of the board. BUSY needs a packet number, so the board cannot
// refuse a paper host without numbers. While another host is served, such a host is not served.
bool BridgedPair::is_judged(const Datagram& heartbeat) const {
  if (heartbeat.session_id() == no_session) return heartbeat.has_pnum() || known_.served().empty();
  const auto board_t = static_cast<std::uint32_t>(board_t_);
  const auto ago =
      static_cast<std::int32_t>(board_t - static_cast<std::uint32_t>(heartbeat.time_ms()));
  return board_t != 0 && heartbeat.has_pnum() && heartbeat.time_ms() != 0 &&
         milliseconds(std::abs(std::int64_t{ago})) <= timeout_;
}

// The carrier keeps the peers of served hosts while other peers send.
void BridgedPair::follow_hosts(Time now) {
  if (!known_.poll(now)) return;
  const std::vector<Peer>& served = known_.served();
  hosts_.end.hold(served.empty() ? everyone : served.front());
  for (const Peer peer : served) hosts_.end.also_hold(peer);
  if (served.empty() || !watch_.asked()) return;
  std::array<char, max_datagram> buffer;
  DatagramWriter writer(buffer.data(), buffer.size());
  const Text farewell = watch_.write_end(writer);
  // A served host gets states without a lease. Programs that share the transport may need a lease.
  if (!board_.carrier->is_shared()) send(board_, view(farewell), Priority::normal, everyone);
}

bool BridgedPair::is_allowed(const Datagram& datagram, MessageKind kind, Peer from, Time now) {
  const Verdict verdict = guard_.judge(datagram, now);
  if (verdict == Verdict::authentic) return true;
  ++hosts_.counters.refused;
  if (!guard_.may_answer(verdict)) return false;
  if (kind == MessageKind::command) {
    answer(datagram, Refusal::auth, 0, from, now);
  } else {
    audience_.listen(from, now);  // the board's heartbeat carries the nonce
  }
  return false;
}

void BridgedPair::on_lease(const Datagram& datagram, Peer from, Time now) {
  Command command;
  FieldSet fields;
  Refusal refusal = parse_command(datagram.command(), command);
  if (refusal == Refusal::none && !command.text.empty()) {
    refusal = parse_fields(command.text, fields);
  }
  if (refusal != Refusal::none) {
    if (refusals_.take(ms_of(now))) answer(datagram, refusal, 0, from, now);
    return;
  }
  const Source watcher{0, from};
  const auto rate_hz = static_cast<std::uint32_t>(command.value);
  switch (watchers_.on_lease(watcher, rate_hz, datagram.time_ms(), false, ms_of(now))) {
    case Watchers::Effect::watching:
      return watch_.wish(datagram.command().values());
    case Watchers::Effect::unproven: {
      const std::uint32_t token = std::max(random_(), 1U);  // 0 is the T of a first W
      watchers_.tell(watcher, token, ms_of(now));
      return answer(datagram, Refusal::stale, token, from, now);
    }
    case Watchers::Effect::full:
      return answer(datagram, Refusal::busy, 0, from, now);
    case Watchers::Effect::ended:
    case Watchers::Effect::ignored:
      return;
  }
}

void BridgedPair::on_board_datagram(const Datagram& datagram, Time now) {
  if (is_old(board_, now)) return;
  const MessageKind kind = kind_of(datagram);
  if (kind == MessageKind::command || kind == MessageKind::host_heartbeat) {
    ++board_.counters.misdirected;
    return;
  }
  guard_.on_board_datagram(datagram, kind, now);
  report_trouble();
  if (datagram.has_pnum() && datagram.has_time()) {
    board_pnum_ = datagram.pnum();
    board_t_ = datagram.time_ms();
    board_heard_ = now;
  }
  switch (kind) {
    case MessageKind::nack:
    case MessageKind::identity:
      return on_answer(datagram, kind, now);
    case MessageKind::board_heartbeat:
      if (is_connecting_heartbeat(datagram) || heartbeat_reason(datagram) == SafeReason::link) {
        known_.on_board_free();
      }
      return deliver_to_hosts(datagram, false, now);
    default:
      watch_.on_state(now);
      return deliver_to_hosts(datagram, true, now);
  }
}

// While no host is served, a heartbeat also goes to all peers that one datagram reaches.
void BridgedPair::deliver_to_hosts(const Datagram& datagram, bool is_state, Time now) {
  const Priority priority = is_state ? Priority::state : Priority::normal;
  const std::vector<Peer>& served = known_.served();
  const bool to_everyone = served.empty() && !is_state;
  if (to_everyone) deliver(board_, hosts_, datagram, priority);
  if (!served.empty()) deliver(board_, hosts_, datagram, priority, served.front());
  const auto copy = [&](Peer peer) { send(hosts_, view(datagram.bytes()), priority, peer); };
  for (std::size_t i = 1; i < served.size(); ++i) copy(served[i]);
  const auto has_it = [&](Peer peer) {
    return std::find(served.begin(), served.end(), peer) != served.end() ||
           (to_everyone && hosts_.end.reaches(peer));
  };
  for (const Watcher& each : watchers_) {
    if (each.period_ms != 0 && !has_it(each.at.peer)) copy(each.at.peer);
  }
  if (is_state) return;
  audience_.for_each_listener(now, [&](Peer peer) {
    const bool gets_it = has_it(peer) || watchers_.find({0, peer}) != nullptr;
    if (!gets_it && copies_.take(ms_of(now))) copy(peer);
  });
}

void BridgedPair::on_answer(const Datagram& answer, MessageKind kind, Time now) {
  const SessionId sid = answer.session_id();
  std::optional<Peer> asker;
  Nack nack;
  Identity identity;
  if (kind == MessageKind::nack) {
    if (!read_nack(answer, nack) || watch_.on_refusal(nack, now)) return;
    if (!known_.serves(sid, now)) asker = audience_.asker_of(nack.pnum, sid, now);
  } else {
    if (!read_identity(answer, identity)) return;
    std::optional<std::uint32_t> pnum;
    if (identity.has_asked) pnum = identity.asked;
    asker = audience_.asker_of(pnum, sid, now);
  }
  const auto pass = [&](Peer peer) { deliver(board_, hosts_, answer, Priority::normal, peer); };
  asker ? pass(*asker) : known_.for_each_path(sid, now, pass);
  if (kind != MessageKind::nack || nack.code != Refusal::busy) return;
  known_.on_busy(sid, now);
  follow_hosts(now);
}

void BridgedPair::watch_board(Time now) {
  watchers_.poll(ms_of(now));
  if (!board_.opened || !known_.served().empty()) return;
  if (!watchers_.any()) watch_.wish_nothing();
  if (!watch_.due(now)) return;
  std::array<char, max_datagram> buffer;
  DatagramWriter writer(buffer.data(), buffer.size());
  send(board_, view(watch_.write(writer, now)), Priority::lease, everyone);
}

void BridgedPair::report_trouble() {
  const BridgeGuard::Trouble trouble = guard_.trouble();
  if (std::exchange(reported_, trouble) == trouble || !on_event_) return;
  Problem problem{ErrorKind::refused, board_.carrier->name(), "", ""};
  switch (trouble) {
    case BridgeGuard::Trouble::none:
      return;
    case BridgeGuard::Trouble::board_has_no_key:
      problem.reason = "the board has no key, and this bridge passes only signed datagrams";
      problem.fix =
          "end the bridge and give the board the key over its cable (r4 key give FILE URL), or "
          "start the bridge without --key";
      break;
    case BridgeGuard::Trouble::key_needed:
      problem.reason =
          "the board has a key, but this bridge does not have the key, so it cannot check "
          "signatures and passes only stops and questions";
      problem.fix = "give the bridge the key: r4 bridge … --key FILE";
      break;
  }
  on_event_(BridgeSide::board, {CarrierEvent::Kind::warning, problem});
}

// Answers in place of the board. `session`: the SESSION of a refusal.
void BridgedPair::answer(const Datagram& asked, Refusal code, std::uint32_t lease, Peer to,
                         Time now, std::optional<std::uint32_t> session) {
  if (!asked.has_pnum() || !board_heard_ || now - *board_heard_ > clock_lifetime) return;
  Nack nack;
  nack.pnum = asked.pnum();
  nack.sid = asked.session_id();
  nack.code = code;
  nack.lease = lease;
  nack.has_session = session.has_value();
  nack.session = session.value_or(0);
  std::array<char, 160> buffer;
  DatagramWriter writer(buffer.data(), buffer.size());
  write_nack(writer, nack);
  const auto since = std::chrono::duration_cast<milliseconds>(now - *board_heard_).count();
  const Text text = writer.finish(board_pnum_, board_t_ + static_cast<std::uint64_t>(since));
  send(hosts_, view(text), Priority::normal, to);
}

// Delivers to the board. The answer to an untrusted host goes to the peer `from`.
void BridgedPair::pass_on(const Datagram& datagram, Peer from, bool trusted, Time now) {
  if (!trusted) {
    std::optional<std::uint32_t> pnum;
    if (datagram.has_pnum()) pnum = datagram.pnum();
    audience_.on_question(from, pnum, datagram.session_id(), now);
  }
  deliver(hosts_, board_, datagram, Priority::normal);
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
