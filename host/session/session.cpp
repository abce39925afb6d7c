// SPDX-License-Identifier: GPL-3.0-or-later
#include "session.hpp"

#include <algorithm>
#include <random>
#include <utility>

#include "../commands/command_help.hpp"
#include "../commands/limits.hpp"
#include "r4link/error.hpp"

namespace r4 {

namespace {

std::uint64_t random_bits() {
  std::random_device random;
  return std::uint64_t{random()} << 32 | random();
}

// The longest wait. Time::max() would overflow in nanoseconds.
constexpr Time longest_wait = std::chrono::hours{1};

// Called before the first use of the options, because arithmetic with their times could overflow.
SessionOptions checked(SessionOptions options) {
  require_valid(options);
  if (FieldSet set; !options.fields.empty() && parse_fields(options.fields, set) != Refusal::none) {
    throw Error(bad_command("F:" + options.fields, Refusal::unknown));
  }
  return options;
}

}  // namespace

Session::Session(SessionOptions options, BoardRole role, std::size_t paths,
                 std::function<std::uint64_t()> random)
    : options_(checked(std::move(options))),
      random_(random ? std::move(random) : [] { return random_bits(); }),
      link_(options_.timing, static_cast<std::uint32_t>(random_())),
      key_(options_.key, options_.clock_start),
      paths_(paths, options_.timing, link_),
      board_(options_.identify_interval),
      outbox_(effects_, link_, key_, paths_, role),
      keeper_(options_, link_, key_, paths_, outbox_, statistics_.counts),
      arming_(options_.arming, effects_, statistics_.counts),
      commands_(options_, link_, keeper_, outbox_, board_, arming_, effects_, statistics_.counts),
      posts_(effects_, outbox_, statistics_.counts) {
  begin_session();
  if (options_.fields.empty()) return;
  require_valid(keeper_.with_needed_fields(Command::fields(options_.fields)));
}

void Session::begin_session() {
  while (link_.wants_session()) link_.begin_session(random_());
}

void Session::poll(Time now) {
  link_.poll(to_ms(now));
  if (link_.long_silent(to_ms(now))) forget_board(now);
  keeper_.ask_paths(now);
  refresh(now);
  if (commands_.expire(now)) on_failed_stop(now);
  // A heartbeat that arrives before the stop could resume the outputs.
  keeper_.hold_for_stop(commands_.is_stopping() && !keeper_.is_up());
  keeper_.keep_alive(now);
  arming_.expire(now);
  if (!keeper_.controls()) keeper_.select_fields(now);  // before commands, when the link comes up
  commands_.send_queued(now);
  advance_arming(now);
  commands_.refuse_held_back(now);
  commands_.send_queued(now);  // commands that waited for arm()
  commands_.repeat(now);
  if (!keeper_.is_leaving() && keeper_.hears_board() && now >= board_.next_question()) {
    board_.ask(outbox_.send(Command::identify(), {}, now).pnum, now);
  }
}

Time Session::next_poll(Time now) {
  Time next = std::min({commands_.next(), arming_.next_deadline(), now + longest_wait});
  if (keeper_.is_leaving()) return next;
  next = std::min(next, keeper_.next(now));
  return keeper_.hears_board() ? std::min(next, board_.next_question()) : next;
}

void Session::refresh(Time now) {
  keeper_.update();
  arming_.on_link(keeper_.is_up(), keeper_.in_control(now), link_.state() == HostLinkState::safe,
                  link_.reason(), now);
  const LinkStatus fresh = keeper_.status(board_.state().fault, now);
  if (fresh == status_) return;
  status_ = fresh;
  effects_.report(status_);
}

void Session::on_sent(const Sending& sending, SendResult result, Time now) {
  keeper_.on_sent(sending, result, now);
  posts_.on_sent(sending, result);
  if (result == SendResult::busy) refresh(now);
}

void Session::on_transport(std::size_t path, bool up, Time now, bool can_ask) {
  keeper_.on_transport(path, up, can_ask, now);
  refresh(now);
}

// Ends the session at once, because a board with a longer timeout may be driving.
void Session::on_sleep(Time now) {
  if (may_say_farewell()) outbox_.send(Command::leave(), {.echo = link_.echo()}, now);
  commands_.forget_stop();
  arming_.on_sleep();
  forget_board(now);
  refresh(now);
}

// A new session begins, because the board would resume the outputs of the present session.
void Session::on_failed_stop(Time now) {
  if (watches() || keeper_.is_leaving()) return;
  end_all_but_stops(Outcome::cancelled, now);
  if (may_say_farewell()) outbox_.send(Command::leave(), {.echo = link_.echo()}, now);
  keeper_.begin_anew();
  begin_session();
  refresh(now);
}

// The board's next T is unrelated to earlier T.
void Session::forget_board(Time now) {
  link_.begin_anew();
  paths_.on_sleep(now);
  on_new_boot(now);
}

void Session::on_restart(Time now) {
  link_.on_restart();
  link_.on_heard(to_ms(now));
  on_new_boot(now);
}

// If the board did not report a restart, this host's clock may have stopped instead, with the
// deadlines of commands. Then a new session begins, and the commands end.
void Session::on_new_boot(Time now) {
  board_.on_restart();
  arming_.disarm(DisarmCause::restart);
  if (link_.wants_session()) {
    begin_session();
    arming_.end(Outcome::cancelled, Refusal::none, now);
    commands_.give_up(now);
  }
  effects_.report(BoardRestarted{});
}

void Session::advance_arming(Time now) {
  if (arming_.take_abandoned()) commands_.remove_step();
  if (!arming_.any() || !keeper_.in_control(now) || commands_.delays_arming()) return;
  const std::optional<Command> step = arming_.next_step(link_.reason(), now);
  if (step && !commands_.send_step(*step, now)) arming_.end(Outcome::full, Refusal::none, now);
}

Ticket Session::arm(Time timeout, Time now) {
  require_control(board_role(), "arm()");
  const Ticket ticket = commands_.take_ticket();
  return arming_.add(ticket, commands_.cause(), now + timeout, now) ? ticket : 0;
}

Ticket Session::send(const Command& command, Time timeout, Time now) {
  require_valid(command);
  require_control(board_role(), command);
  if (command.kind == CommandKind::stop) {
    // A command from before the stop must not follow the stop.
    end_all_but_stops(Outcome::cancelled, now);
    arming_.disarm(DisarmCause::stop);
  }
  return commands_.send(keeper_.with_needed_fields(command), timeout, now);
}

Ticket Session::send(const Setpoints& group, Time timeout, Time now) {
  require_any(group);
  require_control(board_role(), group);
  return commands_.send(group, timeout, now);
}

PostResult Session::gate_of_posts(CommandKind kind, Time now) {
  commands_.send_queued(now);  // earlier commands are sent first
  if (!in_control(now)) return PostResult::no_link;
  if (commands_.is_held_back(kind)) {
    ++statistics_.counts.refused;
    return PostResult::not_armed;
  }
  return commands_.is_group_ahead() ? PostResult::queue_full : PostResult::sent;
}

PostResult Session::post(const Command& command, Time now) {
  require_valid(command);
  require_control(board_role(), command);
  const PostResult gate = gate_of_posts(command.kind, now);
  if (!gate) return gate;
  const bool unnamed =
      command.kind == CommandKind::clear && command.value == Command::unnamed_cause;
  return posts_.send(unnamed ? Command::clear(commands_.cause()) : command, now);
}

PostResult Session::posted() {
  const PostResult result = posts_.result();
  // A repeated stop would undo the E:CLEAR.
  if (result && posts_.is_clear()) commands_.forget_stop();
  return result;
}

PostResult Session::post(const Setpoints& group, Time now) {
  require_any(group);
  require_control(board_role(), group);
  if (group.size() == 1) return post(group[0], now);
  const PostResult gate = gate_of_posts(group[0].kind, now);
  if (!gate) return gate;
  if (!commands_.knows_groups(now) || posts_apart()) return PostResult::no_link;
  return posts_.send(group, now);
}

void Session::cancel(Ticket ticket, Time now) {
  if (!arming_.cancel(ticket, now)) commands_.cancel(ticket, now);
  advance_arming(now);
}

// Needs no capability, because a board that confirms commands refuses an unknown farewell.
bool Session::may_say_farewell() const {
  return keeper_.is_up() && !watches() && board_.may_know_leave();
}

Ticket Session::leave(Time timeout, Time now, Outcome outcome) {
  end_all_but_stops(outcome, now);
  arming_.begin_anew();
  keeper_.leave(now);
  return may_say_farewell() ? commands_.leave(timeout, now) : 0;
}

void Session::change_role(BoardRole role, Time now) {
  end_all_but_stops(Outcome::cancelled, now);
  arming_.begin_anew();
  outbox_.change_role(role);
  keeper_.begin_anew();
  begin_session();
  refresh(now);
}

void Session::end_all_but_stops(Outcome outcome, Time now) {
  arming_.end(outcome, Refusal::none, now);
  commands_.end_all_but_stops(outcome, now);
}

void Session::end_all(Time now) {
  arming_.end(Outcome::closed, Refusal::none, now);
  commands_.end_all(now);
}

void Session::watchdog(std::chrono::milliseconds period, Time now) {
  link_.watchdog(static_cast<std::uint32_t>(period.count()), to_ms(now));
  refresh(now);
}

void Session::hold(bool held, Time now) {
  keeper_.hold(held);
  refresh(now);
}

void Session::feed(Time now) {
  link_.feed(to_ms(now));
  refresh(now);
}

Statistics Session::statistics(Time now) const {
  Statistics report = statistics_.report(now);
  report.packets = packets();
  // Counts only restarts of the board: packet numbers also restart when a transport comes up.
  report.packets.restarts = link_.restarts();
  report.copies = packets().duplicate;
  report.received -= report.copies;
  if (state().sampled_error != ReceivedState::unknown) {
    report.clock_drift_ppm = board_.clock().drift_ppm();
    report.clock_drift_error_ppm = board_.clock().drift_error_ppm();
  }
  return report;
}

}  // namespace r4
