// SPDX-License-Identifier: GPL-3.0-or-later
// An AsyncBoard does what its session wants done: it sends, then it tells.
#include <utility>
#include <variant>

#include "async_board_impl.hpp"

namespace r4 {

void AsyncBoard::Impl::send_all() {
  Effects& effects = session.effects();
  Effects::Room room;
  while (effects.any_sendings()) {
    const Sending sending = effects.take_sending(room);
    session.on_sent(sending, transmit(sending), now);
  }
}

void AsyncBoard::Impl::notify_all() {
  Effects& effects = session.effects();
  while (effects.any_events()) {
    std::visit([this](const auto& event) { notify(event); }, effects.take_event());
  }
}

// Who only watches says nothing on a bus but stops and leases.
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

void AsyncBoard::Impl::notify(const StateCame&) {
  if (!is_open()) return;
  const Datagram& datagram = session.effects().datagram();
  if (backlog.keeps_states()) {
    backlog.keep(datagram.bytes());
  } else {
    call(callbacks.state, session.state(), datagram);
  }
}

void AsyncBoard::Impl::notify(const HeartbeatCame&) {
  if (is_open()) call(callbacks.heartbeat, session.effects().datagram());
}

void AsyncBoard::Impl::notify(const BoardIdentified& event) {
  const Identity& fresh = event.identity;
  identity.firmware.assign(fresh.firmware.data(), fresh.firmware.size());
  identity.board_id.assign(fresh.board_id.data(), fresh.board_id.size());
  identity.capabilities.assign(fresh.capabilities.data(), fresh.capabilities.size());
  identity.name.assign(fresh.name.data(), fresh.name.size());
  if (paths[0].tap.attached()) name_in_recording();
}

void AsyncBoard::Impl::notify(const CommandRefused& event) {
  if (is_open()) call(callbacks.nack, event.nack, session.effects().datagram());
}

void AsyncBoard::Impl::notify(const BadDatagramCame& event) {
  if (is_open()) call(callbacks.bad, event.result, event.bytes);
}

void AsyncBoard::Impl::notify(const LinkChanged& event) {
  paths[0].tap.on_link(event.status);
  notify_paths(event.status);
  if (!is_open()) return;
  // As it is by then: the one before may have changed it.
  callbacks.link.each([&](auto& one) {
    if (may_tell()) guarded([&] { one(session.link()); });
  });
}

// Which have begun to carry, or ceased to; and that one leads to another board.
void AsyncBoard::Impl::notify_paths(const LinkStatus& status) {
  const LinkStatus before_that = std::exchange(told, status);
  for (std::size_t i = 0; i < paths.size(); ++i) {
    if (((before_that.carrying ^ status.carrying) & path_bit(i)) == 0) continue;
    if (is_open()) call(callbacks.path, report(i));
  }
  constexpr LinkCauses elsewhere{LinkCause::two_boards, LinkCause::other_board};
  if (status.causes.has_any(elsewhere) && !before_that.causes.has_any(elsewhere) && is_open()) {
    std::vector<PathStatus> reports;
    for (std::size_t i = 0; i < paths.size(); ++i) reports.push_back(report(i));
    call(callbacks.event, CarrierEvent{CarrierEvent::Kind::warning, explain(reports)});
  }
}

void AsyncBoard::Impl::notify(const BoardRestarted&) {
  ++boots;
  backlog.forget();
  if (is_open()) call(callbacks.restart);
}

void AsyncBoard::Impl::notify(const ArmingChanged&) {
  if (!is_open()) return;
  callbacks.arming.each([&](auto& one) {
    if (may_tell()) guarded([&] { one(session.disarmed_by()); });
  });
}

void AsyncBoard::Impl::notify(const PostRefused& event) {
  if (is_open()) call(callbacks.refused, event.refused);
}

void AsyncBoard::Impl::notify(const CommandEnded& event) { waits.end(event.ticket, event.result); }

}  // namespace r4
