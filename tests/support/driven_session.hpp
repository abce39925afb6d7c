// SPDX-License-Identifier: GPL-3.0-or-later
// A session that performs its effects at the end of each call, as in AsyncBoard. The session passes
// its datagrams to transmit(), then its events to the functions with their names.
#pragma once

#include <optional>
#include <string_view>
#include <utility>
#include <variant>

#include "host/session/session.hpp"

namespace r4::test {

class DrivenSession : public Session {
 public:
  class Handler {
   public:
    virtual SendResult transmit(std::size_t path, std::string_view datagram, Priority priority) = 0;
    virtual TransportTrouble trouble() const { return TransportTrouble::none; }
    virtual void on_state(const ReceivedState&, const Datagram&) {}
    virtual void on_board_heartbeat(const Datagram&) {}
    virtual void on_identity(const Identity&) {}
    virtual void on_nack(const Nack&, const Datagram&) {}
    virtual void on_bad_datagram(const ReadResult&, std::string_view) {}
    virtual void on_link(const LinkStatus&) {}
    virtual void on_result(Ticket, const CommandResult&) {}
    virtual void on_restart() {}
    virtual void on_arming(DisarmCause) {}
    virtual void on_refused(const RefusedPost&) {}

   protected:
    ~Handler() = default;
  };

  template <class... Arguments>
  explicit DrivenSession(Handler& handler, Arguments&&... arguments)
      : Session(std::forward<Arguments>(arguments)...), handler_(handler) {}

  // Returns the time of the next poll().
  Time poll(Time now) {
    on_trouble(handler_.trouble());
    Session::poll(now);
    perform(now);
    return next_poll(now);
  }
  void receive(std::size_t path, std::string_view bytes, Time now) {
    on_trouble(handler_.trouble());
    Session::receive(path, bytes, now);
    perform(now);
  }
  void on_transport(std::size_t path, bool up, Time now, bool can_ask = true) {
    Session::on_transport(path, up, now, can_ask);
    perform(now);
  }
  void on_sleep(Time now) {
    Session::on_sleep(now);
    perform(now);
  }
  template <class What>
  Ticket send(const What& what, Time timeout, Time now) {
    return done(Session::send(what, timeout, now), now);
  }
  template <class What>
  PostResult post(const What& what, Time now) {
    return done(post_by(*this, what, now, [&] { send_all(now); }), now);
  }
  Ticket arm(Time timeout, Time now) { return done(Session::arm(timeout, now), now); }
  Ticket leave(Time timeout, Time now, Outcome outcome = Outcome::closed) {
    return done(Session::leave(timeout, now, outcome), now);
  }
  void change_role(BoardRole role, Time now) {
    Session::change_role(role, now);
    perform(now);
  }
  void cancel(Ticket ticket, Time now) {
    Session::cancel(ticket, now);
    perform(now);
  }
  void watchdog(std::chrono::milliseconds period, Time now) {
    Session::watchdog(period, now);
    perform(now);
  }
  void feed(Time now) {
    Session::feed(now);
    perform(now);
  }
  void hold(bool held, Time now) {
    Session::hold(held, now);
    perform(now);
  }

 private:
  template <class Result>
  Result done(Result result, Time now) {
    perform(now);
    return result;
  }
  void send_all(Time now) {
    Effects::Room room;
    while (effects().any_sendings()) {
      const Sending sending = effects().take_sending(room);
      on_sent(sending, handler_.transmit(sending.path, sending.datagram, sending.priority), now);
    }
  }
  void perform(Time now) {
    send_all(now);
    while (effects().any_events()) {
      std::visit([this](const auto& event) { notify(event); }, effects().take_event());
    }
  }
  void notify(const StateCame&) { handler_.on_state(state(), effects().datagram()); }
  void notify(const HeartbeatCame&) { handler_.on_board_heartbeat(effects().datagram()); }
  void notify(const Identity& identity) { handler_.on_identity(identity); }
  void notify(const Nack& nack) { handler_.on_nack(nack, effects().datagram()); }
  void notify(const BadDatagramCame& event) { handler_.on_bad_datagram(event.result, event.bytes); }
  void notify(const LinkStatus& status) { handler_.on_link(status); }
  void notify(const CommandEnded& event) { handler_.on_result(event.ticket, event.result); }
  void notify(const BoardRestarted&) { handler_.on_restart(); }
  void notify(DisarmCause cause) { handler_.on_arming(cause); }
  void notify(const RefusedPost& refused) { handler_.on_refused(refused); }

  Handler& handler_;
};

}  // namespace r4::test
