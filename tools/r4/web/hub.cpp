// SPDX-License-Identifier: GPL-3.0-or-later
#include "hub.hpp"

#include <fmt/format.h>

#include <asio/post.hpp>
#include <utility>
#include <variant>

#include "../formats/json_lines.hpp"
#include "../watch/board_metrics.hpp"
#include "r4link/commands/command_text.hpp"
#include "r4link/discovery/url_pattern.hpp"
#include "r4link/error.hpp"
#include "r4link/setpoints.hpp"

namespace r4::tool::web {
namespace {

using namespace std::chrono_literals;

constexpr auto tick_time = 25ms;
constexpr auto command_time = 1s, arm_time = 2s;
// Pages echo received times, so the server must send this often.
constexpr auto longest_silence = 100ms;

template <class Unit>
Unit wall_time() {
  return std::chrono::duration_cast<Unit>(std::chrono::system_clock::now().time_since_epoch());
}
std::int64_t wall_ms() { return wall_time<std::chrono::milliseconds>().count(); }

// Throws for commands that only r4 send (setup) or r4 web itself (link) may send.
void require_allowed(const Command& command) {
  switch (command.kind) {
    case CommandKind::setting:
      throw Error(ErrorKind::usage, shown(command), "a page cannot change settings",
                  "use r4 send URL " + shown(command));
    case CommandKind::heartbeat:
    case CommandKind::leave:
    case CommandKind::watch:
      throw Error(ErrorKind::usage, shown(command), "is sent by r4 web itself",
                  "leave this command out");
    default:
      break;
  }
}

}  // namespace

Hub::Hub(BoardSet& boards, const HubOptions& options)
    : io_(boards.io()),
      devices_(options.devices),
      columns_(devices_),
      changed_(boards.size()),
      tick_(io_),
      deadline_(io_),
      recording_(
          io_, options.record_folder,
          [this](Recording& recording) {
            for (const auto& board : boards_) board->board().record(recording);
          },
          [this](const WebRecording::Told&) { tell_recording(); }),
      foxglove_(
          boards.size(), std::to_string(wall_ms()),
          [this](ClientId client, Outgoing message) { server_.send(client, std::move(message)); }),
      server_(options.server, *this) {
  for (SetBoard& each : boards) {
    boards_.push_back(
        std::make_unique<WebBoard>(io_, each, devices_, static_cast<WebBoard::Events&>(*this)));
    all_.push_back(boards_.back().get());
    rows_.emplace_back(columns_);
  }
}

Hub::~Hub() = default;

void Hub::start() {
  server_.start();
  tick();
  tick_.every(tick_time, [this] { tick(); });
}

void Hub::end() {
  closing_ = true;
  tick_.cancel();
  deadline_.cancel();
  recording_.end();
}

Control::Time Hub::now() const {
  return std::chrono::duration_cast<Control::Time>(BootClock::now() - began_);
}

void Hub::on_open(ClientId client, Protocol protocol) {
  if (protocol == Protocol::foxglove) return foxglove_.on_open(client);
  asio::post(io_, [this, client] { greet(client); });
}

void Hub::on_message(ClientId client, Protocol protocol, std::string text) {
  if (protocol == Protocol::foxglove) {
    if (!foxglove_.on_message(client, text)) {
      return server_.drop(client, "the message is not valid in foxglove.websocket.v1");
    }
    return server_.read_on(client);
  }
  std::optional<PageRequest> request = page_request(text);
  if (!request) {
    server_.send(
        client,
        {std::make_shared<const std::string>(error_text("the message is not valid in r4.web.v1")),
         "", Outgoing::Kind::other});
    return server_.drop(client, "the message is not valid in r4.web.v1");
  }
  asio::post(io_, [this, client, request = std::move(*request)] {
    obey(client, request);
    server_.read_on(client);
  });
}

void Hub::on_closed(ClientId client, Protocol protocol) {
  if (protocol == Protocol::foxglove) return foxglove_.on_closed(client);
  asio::post(io_, [this, client] { leave(client); });
}

void Hub::on_metrics() {
  asio::post(io_, [this] {
    MetricFamilies families;
    for (const auto& each : boards_) {
      describe(each->set_board(), families);
    }
    server_.set_metrics(families.text());
  });
}

void Hub::on_state(std::size_t board, const ReceivedState&, const Datagram& datagram) {
  if (!pages_.empty()) rows_[board].add(datagram, wall_ms());
  on_datagram(board, datagram);
}

void Hub::on_datagram(std::size_t board, const Datagram& datagram) {
  if (!foxglove_.wanted(board, Foxglove::Topic::record)) return;
  const auto time = wall_time<std::chrono::microseconds>();
  server_.run(
      [this, board, time, bytes = std::string(datagram.bytes().data(), datagram.bytes().size())] {
        Json object = Json::object();
        add_record_json(
            object, {time, static_cast<std::uint16_t>(board + 1), RecordKind::from_board, bytes});
        foxglove_.publish(board, Foxglove::Topic::record, time.count(), text_of(object));
      });
}

void Hub::on_change(std::size_t board) { changed_[board] = true; }

void Hub::on_event(std::size_t board, WebBoard::Level level, const std::string& text) {
  const std::int64_t time = wall_ms();
  std::string message = event_text(board, level, text, time);
  if (foxglove_.wanted(board, Foxglove::Topic::event)) {
    server_.run([this, board, time, message] {
      foxglove_.publish(board, Foxglove::Topic::event, time * 1000, message);
    });
  }
  tell_all(std::move(message));
}

void Hub::greet(ClientId client) {
  pages_.insert(client);
  tell(client, hello_text(columns_, all_, client, wall_ms()));
  for (std::size_t i = 0; i < boards_.size(); ++i) tell(client, board_text(i, *boards_[i]));
  tell_control(client, "");
  tell_recording(client, recording_.told().why);
}

void Hub::leave(ClientId client) {
  pages_.erase(client);
  if (control_.release(client)) end_control("the browser in control has disconnected");
}

void Hub::obey(ClientId client, const PageRequest& request) {
  if (closing_) return;
  look_at_holder();
  switch (request.kind) {
    case PageRequest::Kind::stop:
      return stop(client, request);
    case PageRequest::Kind::control:
      return want_control(client, request.on);
    case PageRequest::Kind::alive:
      if (!control_.alive(client, Control::Time(request.now), now())) return;
      for (const auto& board : boards_) board->board().feed();
      return;
    case PageRequest::Kind::record:
      return record(client, request.on);
    case PageRequest::Kind::command:
    case PageRequest::Kind::arm:
    case PageRequest::Kind::clear:
      return command(client, request);
  }
}

void Hub::want_control(ClientId client, bool wanted) {
  if (!wanted) {
    if (control_.release(client)) end_control("control was given back");
    return;
  }
  if (control_.is_held_by(client)) return;
  if (!control_.take(client, now())) {
    return tell_control(client, control_.leaving()
                                    ? "the earlier control is still ending; ask again"
                                    : "another browser has control");
  }
  for (const auto& board : boards_) {
    try {
      board->take_control();
    } catch (const Error& error) {
      control_.release(client);
      return end_control(error.what());
    }
  }
  watch_holder();
  tell_control("");
}

void Hub::watch_holder() {
  deadline_.after(*control_.deadline() - now(), [this] {
    look_at_holder();
    if (control_.holder()) watch_holder();
  });
}

// The timer stops while this computer sleeps, so check before the first message after waking.
void Hub::look_at_holder() {
  if (!control_.expired(now())) return;
  control_.release(*control_.holder());
  end_control(fmt::format("the browser in control was silent for {} ms", Control::limit.count()));
}

void Hub::end_control(const std::string& why) {
  deadline_.cancel();
  const auto left = std::make_shared<std::size_t>(boards_.size());
  for (const auto& board : boards_) {
    board->leave_control([this, left] {
      if (--*left == 0) control_.left();
    });
  }
  tell_control(why);
}

void Hub::tell_control(const std::string& why) {
  for (const ClientId client : pages_) tell_control(client, why);
}

void Hub::tell_control(ClientId client, const std::string& why) {
  Json object{{"type", "control"}, {"holder", nullptr}};
  if (control_.holder()) object["holder"] = *control_.holder();
  object["you"] = control_.is_held_by(client);
  object["why"] = why;
  tell(client, text_of(object));
}

// The controlling browser may start and end any recording. A browser may always end its own.
void Hub::record(ClientId client, bool on) {
  if (!control_.is_held_by(client) && (on || !recording_.is_of(client))) {
    return tell_recording(client, "this browser is not in control; take control first");
  }
  if (on) return recording_.begin(client);
  recording_.end();
}

void Hub::answer(ClientId client, const PageRequest& request, std::size_t board, bool ok, double ms,
                 const std::string& text) {
  tell(client, result_text(request.request, board, ok, ms, text));
}

template <class What>
WebBoard::OnResult Hub::answering(ClientId client, const PageRequest& request, std::size_t board,
                                  What what) {
  return [this, client, request, board, what = std::move(what)](const CommandResult& result) {
    const bool ok = result.outcome == Outcome::confirmed;
    const double ms = std::chrono::duration<double, std::milli>(result.elapsed).count();
    Problem problem = explain(what, result, boards_[board]->board().link());
    if (is_earlier(result.disarmed)) problem.fix = "press Clear when the danger is over, then Arm";
    answer(client, request, board, ok, ms,
           ok ? "confirmed" : problem.reason + (problem.fix.empty() ? "" : "; " + problem.fix));
  };
}

void Hub::stop(ClientId client, const PageRequest& request) {
  for (std::size_t i = 0; i < boards_.size(); ++i) {
    boards_[i]->stop(answering(client, request, i, OwnCommand(Command::stop())));
  }
}

void Hub::command(ClientId client, const PageRequest& request) {
  const std::size_t number = request.board;
  if (number >= boards_.size())
    return answer(client, request, number, false, 0, "the board does not exist");
  AsyncBoard& board = boards_[number]->board();
  if (!control_.is_held_by(client)) {
    return answer(client, request, number, false, 0,
                  "this browser is not in control; take control first");
  }
  try {
    if (request.kind == PageRequest::Kind::arm) {
      board.async_arm(arm_time, answering(client, request, number, "arm"));
    } else {
      send(client, request, board,
           request.kind == PageRequest::Kind::clear ? "E:CLEAR" : request.command);
    }
  } catch (const Error& error) {
    answer(client, request, number, false, 0, error.what());
  }
}

void Hub::send(ClientId client, const PageRequest& request, AsyncBoard& board,
               const std::string& text) {
  const CommandOrGroup what = parse_text(text);
  if (const auto* command = std::get_if<OwnCommand>(&what)) require_allowed(*command);
  std::visit(
      [&](const auto& each) {
        board.async_send(each, command_time, answering(client, request, request.board, each));
      },
      what);
}

void Hub::tell(ClientId client, std::string text) {
  server_.send(client,
               {std::make_shared<const std::string>(std::move(text)), "", Outgoing::Kind::other});
}

void Hub::tell_all(std::string text, Outgoing::Kind kind) {
  if (pages_.empty()) return;
  server_.broadcast(Protocol::page,
                    {std::make_shared<const std::string>(std::move(text)), "", kind});
}

void Hub::tell_recording() {
  for (const ClientId client : pages_) tell_recording(client, recording_.told().why);
}

void Hub::tell_recording(ClientId client, const std::string& why) {
  const WebRecording::Told& told = recording_.told();
  tell(client, text_of({{"type", "recording"},
                        {"path", told.path.empty() ? Json() : Json(told.path)},
                        {"bytes", told.bytes},
                        {"you", recording_.is_of(client)},
                        {"why", why}}));
}

void Hub::tick() {
  tell_states();
  const bool second = now() >= next_second_;
  if (second) {
    next_second_ = now() + 1s;
    recording_.look();
  }
  for (std::size_t i = 0; i < boards_.size(); ++i) {
    if (second || changed_[i]) tell_board(i);
    changed_[i] = false;
  }
}

void Hub::tell_board(std::size_t board) {
  std::string text = board_text(board, *boards_[board]);
  const std::string& name = boards_[board]->identity().name;
  const std::int64_t time = wall_ms() * 1000;
  server_.run([this, board, name, time, text] {
    foxglove_.name(board, name);
    if (foxglove_.wanted(board, Foxglove::Topic::link)) {
      foxglove_.publish(board, Foxglove::Topic::link, time, text);
    }
  });
  tell_all(std::move(text));
}

void Hub::tell_states() {
  if (pages_.empty()) return;
  std::string text = fmt::format(R"({{"type":"states","now":{},"boards":[)", now().count());
  bool any = false;
  for (std::size_t i = 0; i < boards_.size(); ++i) {
    if (rows_[i].empty()) continue;
    text += fmt::format(R"({}{{"board":{},"states":)", any ? "," : "", i);
    rows_[i].take(text);
    text += '}';
    any = true;
  }
  if (!any && now() - told_states_ < longest_silence) return;
  told_states_ = now();
  tell_all(text + "]}", Outgoing::Kind::state);
}

}  // namespace r4::tool::web
