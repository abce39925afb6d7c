// SPDX-License-Identifier: GPL-3.0-or-later
#include "web_board.hpp"

#include <fmt/format.h>

#include <chrono>
#include <utility>

#include "../boards/paths.hpp"
#include "control.hpp"

namespace r4::tool::web {
namespace {

using namespace std::chrono_literals;

constexpr auto stop_time = 2s;

}  // namespace

WebBoard::WebBoard(asio::io_context& io, SetBoard& board, const std::vector<Device>& devices,
                   Events& events)
    : io_(io), set_(board), devices_(devices), events_(events) {
  board_.watchdog(Control::limit);
  connect();
}

void WebBoard::take_control() {
  board_.feed();
  board_.take_control();
  if (!devices_.empty()) {
    setup_.emplace(io_, board_, devices_,
                   [this](const Problem& problem) { say(Level::warning, problem.text()); });
  }
  events_.on_change(set_.index);
}

void WebBoard::leave_control(Done done) {
  setup_.reset();
  board_.async_release_control(farewell_time, [this, done = std::move(done)](const auto&) {
    events_.on_change(set_.index);
    done();
  });
}

void WebBoard::stop(OnResult done) {
  board_.async_send(Command::stop(), stop_time, std::move(done));
}

void WebBoard::connect() {
  board_.on_state([this](const ReceivedState& state, const Datagram& datagram) {
    events_.on_state(set_.index, state, datagram);
  });
  board_.on_board_heartbeat([this](const Datagram& datagram) {
    if (const BoardIdentity& now = board_.identity(); !now.board_id.empty()) identity_ = now;
    events_.on_datagram(set_.index, datagram);
  });
  board_.on_nack(
      [this](const Nack&, const Datagram& datagram) { events_.on_datagram(set_.index, datagram); });
  board_.on_link([this](const LinkStatus& link) { on_link(link); });
  board_.on_event([this](const CarrierEvent& event) {
    if (event.kind != CarrierEvent::Kind::up) say(Level::warning, event.problem.text());
    events_.on_change(set_.index);
  });
  on_paths(board_, [this](const PathStatus& path) {
    const bool carries = path.state == PathState::carrying;
    say(carries ? Level::info : Level::warning,
        fmt::format("path {}: {}", path.name, to_text(path.state)));
    events_.on_change(set_.index);
  });
  board_.on_restart([this] { say(Level::warning, "the board has restarted"); });
  board_.on_arming([this](DisarmCause cause) {
    if (cause == DisarmCause::none) {
      say(Level::info, "armed");
    } else if (cause != DisarmCause::not_yet) {
      say(Level::warning, fmt::format("disarmed: {}", to_text(cause)));
    }
    events_.on_change(set_.index);
  });
}

void WebBoard::on_link(const LinkStatus& link) {
  const bool heard = is_heard(link.state);
  if (heard && !heard_) say(Level::info, "the board is connected");
  const bool lost = link.state == HostLinkState::lost;
  if (lost && heard_) say(Level::warning, explain(url(), link).reason);
  heard_ = heard || (heard_ && !lost);  // a restart has already been reported
  if (heard && link.reason != link_.reason) {
    const bool safe = link.reason != SafeReason::none;
    say(safe ? Level::warning : Level::info,
        safe ? fmt::format("the outputs are off: {}", to_text(link.reason))
             : "the outputs are free");
  }
  link_ = link;
  events_.on_change(set_.index);
}

}  // namespace r4::tool::web
