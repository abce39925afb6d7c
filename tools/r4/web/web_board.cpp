// SPDX-License-Identifier: GPL-3.0-or-later
#include "web_board.hpp"

#include <fmt/format.h>

#include <asio/post.hpp>
#include <chrono>
#include <utility>

#include "../shell/paths.hpp"
#include "control.hpp"
#include "r4link/error.hpp"

namespace r4::tool::web {
namespace {

using namespace std::chrono_literals;

constexpr auto farewell_time = 200ms;
constexpr auto retry_time = 1s;
constexpr auto stop_time = 2s;

}  // namespace

WebBoard::WebBoard(asio::io_context& io, std::size_t number, std::string url, BoardOptions options,
                   const std::vector<Device>& devices, Events& events)
    : io_(io),
      number_(number),
      url_(std::move(url)),
      options_(std::move(options)),
      devices_(devices),
      events_(events),
      retry_(io) {
  make(BoardRole::watch);
}

void WebBoard::make(BoardRole role) {
  BoardOptions options = options_;
  options.role = role;
  controlling_ = role == BoardRole::control;
  options.session.arming = controlling_ ? Arming::required : Arming::off;
  board_ = std::make_unique<AsyncBoard>(io_, url_, options);
  connect();
  if (controlling_ && !devices_.empty()) {
    setup_.emplace(io_, *board_, devices_,
                   [this](const Problem& problem) { say(Level::warning, problem.text()); });
  }
  if (recording_ != nullptr) board_->record(*recording_);
}

void WebBoard::open() { board_->open(); }

void WebBoard::take_control() {
  if (board() == nullptr)
    throw Error(ErrorKind::open, url_, trouble_, "try again when it is there");
  board_.reset();
  try {
    make(BoardRole::control);
    board_->watchdog(Control::limit);
    board_->feed();
    board_->open();
  } catch (const Error&) {
    setup_.reset();
    board_.reset();
    watch();
    throw;
  }
}

void WebBoard::leave_control(Done done) {
  if (!controlling_ || leaving_) return done();
  leave([this, done = std::move(done)] {
    watch();
    done();
  });
}

void WebBoard::close(Done done) {
  retry_.cancel();
  if (board() == nullptr) return done();
  leave(std::move(done));
}

void WebBoard::leave(Done done) {
  leaving_ = true;
  setup_.reset();
  board_->async_close(farewell_time, [this, done = std::move(done)](const CommandResult&) {
    asio::post(io_, [this, done] {  // not from within the board's own call
      board_.reset();
      leaving_ = false;
      done();
    });
  });
}

void WebBoard::watch() {
  try {
    make(BoardRole::watch);
    board_->open();
    trouble_.clear();
    for (OnResult& each : std::exchange(stops_, {})) stop(std::move(each));
  } catch (const Error& error) {
    board_.reset();
    if (trouble_ != error.problem().reason) say(Level::error, error.what());
    trouble_ = error.problem().reason;
    retry_.expires_after(retry_time);
    retry_.async_wait([this](const std::error_code& cancelled) {
      if (!cancelled) watch();
    });
  }
  events_.on_change(number_);
}

void WebBoard::stop(OnResult done) {
  constexpr std::size_t most = 64;
  if (board() != nullptr) {
    board_->async_stop(stop_time, [this, done = std::move(done)](const CommandResult& result) {
      // Its board was closed for one of another role before it had confirmed the stop: that one says it on.
      if (result.outcome == Outcome::closed) return stop(done);
      done(result);
    });
  } else if (leaving_ && stops_.size() < most) {
    stops_.push_back(std::move(done));
  } else {
    done({});  // not confirmed
  }
}

void WebBoard::record(Recording* recording) {
  recording_ = recording;
  if (recording != nullptr && board() != nullptr) board_->record(*recording);
}

void WebBoard::connect() {
  board_->on_state([this](const ReceivedState& state, const Datagram& datagram) {
    events_.on_state(number_, state, datagram);
  });
  board_->on_board_heartbeat([this](const Datagram& datagram) {
    if (const BoardIdentity& now = board_->identity(); !now.board_id.empty()) identity_ = now;
    events_.on_datagram(number_, datagram);
  });
  board_->on_nack(
      [this](const Nack&, const Datagram& datagram) { events_.on_datagram(number_, datagram); });
  board_->on_link([this](const LinkStatus& link) { on_link(link); });
  board_->on_event([this](const CarrierEvent& event) {
    if (event.kind != CarrierEvent::Kind::up) say(Level::warning, event.problem.text());
    events_.on_change(number_);
  });
  on_paths(*board_, [this](const PathStatus& path) {
    const bool carries = path.state == PathState::carrying;
    say(carries ? Level::info : Level::warning,
        fmt::format("path {}: {}", path.name, to_text(path.state)));
    events_.on_change(number_);
  });
  board_->on_restart([this] { say(Level::warning, "the board has begun again"); });
  board_->on_arming([this](DisarmCause cause) {
    if (cause == DisarmCause::none) {
      say(Level::info, "armed");
    } else if (cause != DisarmCause::not_yet) {
      say(Level::warning, fmt::format("disarmed: {}", to_text(cause)));
    }
    events_.on_change(number_);
  });
}

void WebBoard::on_link(const LinkStatus& link) {
  const bool heard = is_heard(link.state);
  if (heard && !heard_) say(Level::info, "the board is there");
  const bool lost = link.state == HostLinkState::lost;
  if (lost && heard_) say(Level::warning, explain(url_, link).reason);
  heard_ = heard || (heard_ && !lost);  // to connect anew, for control, is no news
  if (heard && link.reason != link_.reason) {
    const bool safe = link.reason != SafeReason::none;
    say(safe ? Level::warning : Level::info,
        safe ? fmt::format("the outputs are off: {}", to_text(link.reason))
             : "the outputs are free");
  }
  link_ = link;
  events_.on_change(number_);
}

}  // namespace r4::tool::web
