// SPDX-License-Identifier: GPL-3.0-or-later
#include <utility>
#include <variant>

#include "async_board_impl.hpp"
#include "r4link/wiring/wiring_value.hpp"

namespace r4 {

namespace {

template <class... Calls>
struct Overloaded : Calls... {
  using Calls::operator()...;
};
template <class... Calls>
Overloaded(Calls...) -> Overloaded<Calls...>;

}  // namespace

void AsyncBoard::Impl::send_all() {
  Effects& effects = session.effects();
  Effects::Room room;
  while (effects.any_sendings()) {
    const Sending sending = effects.take_sending(room);
    session.on_sent(sending, transmit(sending), now);
  }
}

// On a bus, a watcher sends only stops and leases.
bool AsyncBoard::Impl::only_listens(std::size_t path) const {
  return session.board_role() == BoardRole::watch && carrier(path).is_shared();
}

SendResult AsyncBoard::Impl::transmit(const Sending& sending) const {
  if (!has_link()) return SendResult::down;
  const std::size_t path = sending.path;
  const bool may_pass = sending.priority == Priority::stop || sending.priority == Priority::lease;
  if (only_listens(path) && !may_pass) return SendResult::down;
  const SendResult result = carrier(path).send(sending.datagram, sending.priority);
  if (result == SendResult::sent) paths[path].tap.on_sent(sending.datagram);
  return result;
}

void AsyncBoard::Impl::notify_all() {
  Effects& effects = session.effects();
  const Datagram& datagram = effects.datagram();
  const Overloaded notify{
      [&](const StateCame&) {
        if (backlog.keeps_states()) {
          backlog.keep(datagram.bytes());
        } else {
          call(callbacks.state, session.state(), datagram);
        }
      },
      [&](const HeartbeatCame&) { call(callbacks.heartbeat, datagram); },
      [&](const Identity& fresh) { on_identity(fresh); },
      [&](const Nack& nack) { call(callbacks.nack, nack, datagram); },
      [&](const BadDatagramCame& event) { call(callbacks.bad, event.result, event.bytes); },
      [&](const LinkStatus& status) {
        paths[0].tap.on_link(status);
        notify_paths(status);
        call(callbacks.link, session.link());  // an earlier callback may have changed it
      },
      [&](const CommandEnded& event) { waits.end(event.ticket, event.result); },
      [&](const BoardRestarted&) {
        ++boots;
        backlog.forget();
        call(callbacks.restart);
      },
      [&](DisarmCause) {
        callbacks.arming.each([&](auto& one) {  // an earlier callback may have changed it
          if (is_open()) guarded([&] { one(session.disarmed_by()); });
        });
      },
      [&](const RefusedPost& refused) { call(callbacks.refused, refused); },
  };
  while (effects.any_events()) std::visit(notify, effects.take_event());
}

void AsyncBoard::Impl::on_identity(const Identity& fresh) {
  identity.firmware.assign(fresh.firmware.data(), fresh.firmware.size());
  identity.board_id.assign(fresh.board_id.data(), fresh.board_id.size());
  identity.capabilities.assign(fresh.capabilities.data(), fresh.capabilities.size());
  identity.name.assign(fresh.name.data(), fresh.name.size());
  BoardWiring wiring;
  if (read_board_wiring(fresh.wiring, wiring)) identity.wiring = wiring;
  if (paths[0].tap.attached()) name_in_recording();
}

void AsyncBoard::Impl::notify_paths(const LinkStatus& status) {
  const LinkStatus before = std::exchange(reported, status);
  for (std::size_t i = 0; i < paths.size(); ++i) {
    if (((before.carrying ^ status.carrying) & path_bit(i)) != 0)
      call(callbacks.path, status_of(i));
  }
  constexpr LinkCauses elsewhere{LinkCause::two_boards, LinkCause::other_board};
  if (status.causes.has_any(elsewhere) && !before.causes.has_any(elsewhere) && is_open()) {
    warn(explain(statuses()));
  }
}

}  // namespace r4
