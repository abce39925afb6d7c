// SPDX-License-Identifier: GPL-3.0-or-later
// Services of a board: each answers after the board's confirmation, or with a failure's reason.
#include <fmt/format.h>

#include <algorithm>
#include <asio/bind_cancellation_slot.hpp>
#include <utility>

#include "board_commands.hpp"
#include "command_text.hpp"
#include "r4link/error.hpp"

namespace r4::tool::ros2 {
namespace {

using namespace std::chrono_literals;

constexpr auto arm_patience = 3000ms;
constexpr auto stop_patience = 5000ms;
constexpr const char* overtaken =
    ": a stop came after the request; call the service again when the danger is over";

template <class What>
std::function<void(const CommandResult&)> in_words(const AsyncBoard& board, What what,
                                                   BoardCommands::Done done) {
  return [&board, what = std::move(what), done = std::move(done)](const CommandResult& result) {
    if (result.outcome == Outcome::confirmed) {
      done(true, fmt::format("{}: confirmed by the board", shown(what)));
    } else if (result.outcome == Outcome::cancelled && !board.in_control()) {
      done(false, explain(shown(what), board.link()).text());
    } else {
      done(false, for_a_node(explain(what, result, board.link()), result.disarmed).text());
    }
  };
}

// A request's client and text; no text if the request is malformed or the service takes no text.
struct Request {
  std::uint64_t client = 0;
  std::int64_t number = 0;
  std::optional<std::string> text;
};
Request request_of(const TriggerRequest& request) { return {request.client, request.number, {}}; }
Request request_of(const AddDiagnosticsRequest& request) {
  return {request.client, request.number, text_of(bytes_of(request.load_namespace))};
}

// Returns false and writes nothing if the reader of a new client is not known yet.
template <class Response>
bool answer(dds_entity_t replies, const Request& request, bool done, const std::string& text,
            bool last) {
  dds_publication_matched_status_t matched{};
  (void)dds_get_publication_matched_status(replies, &matched);
  if (matched.current_count == 0 && !last) return false;
  Response response{};
  response.client = request.client;
  response.number = request.number;
  response.success = done;
  response.message = borrowed(text);
  (void)dds_write(replies, &response);
  return true;
}

}  // namespace

// NOLINTBEGIN(clang-analyzer-cplusplus.NewDeleteLeaks): as in board_commands.cpp.

template <class RequestMessage, class Response>
void BoardCommands::serve(const Room& room, std::string name, const char* type, Act act,
                          Left left) {
  const Graph::Service service = room.graph.serve<RequestMessage, Response>(room.node, name, type);
  const bool stops = name == "~/stop";
  const auto urgent = [stops](const Request& request) {
    return stops || (request.text && asks_to_stop(*request.text));
  };
  add<RequestMessage, Request>(
      room.inbox, name,
      {
          .reader = service.requests,
          .room = 4,
          .read = [](const RequestMessage& request) { return std::optional(request_of(request)); },
          .urgent = urgent,
          .take =
              [this, name, urgent, act = std::move(act), replies = service.replies](
                  const Request& request, const Origin& origin) {
                const Done done = [this, replies, request](bool confirmed,
                                                           const std::string& text) {
                  outbox_.push_attempt([replies, request, confirmed, text](bool last) {
                    return answer<Response>(replies, request, confirmed, text, last);
                  });
                };
                if (!urgent(request) && is_stale(name, origin)) {
                  done(false, fmt::format("{}: the request came too late: dropped", name));
                } else {
                  act(request.text, origin, done);
                }
              },
          .left = std::move(left),
      });
}

// NOLINTEND(clang-analyzer-cplusplus.NewDeleteLeaks)

void BoardCommands::serve_all(Graph& graph, std::size_t node, Inbox& inbox) {
  const Room room{graph, node, inbox};
  const auto serve_trigger = [&](const char* name, Act act) {
    serve<TriggerRequest, TriggerResponse>(room, name, "std_srvs/srv/Trigger", std::move(act), {});
  };
  serve_trigger("~/stop", [this](const auto&, const Origin&, const Done& done) { stop(done); });
  serve_trigger("~/clear", [this](const auto&, const Origin& origin, const Done& done) {
    if (is_overtaken(origin)) return done(false, std::string("~/clear") + overtaken);
    clear(origin, done);
  });
  serve_trigger("~/arm", [this](const auto&, const Origin& origin, const Done& done) {
    if (is_overtaken(origin)) return done(false, std::string("~/arm") + overtaken);
    arm(done);
  });
  const void* const source = sources_.emplace_back(std::make_unique<int>()).get();
  serve<AddDiagnosticsRequest, AddDiagnosticsResponse>(
      room, "~/send", "diagnostic_msgs/srv/AddDiagnostics",
      [this, source](const std::optional<std::string>& text, const Origin& origin,
                     const Done& done) { send(text, source, origin, done); },
      [this, source](const auto& there) { drivers_.on_publishers(source, there); });
}

void BoardCommands::stop(Done done) {
  constexpr std::size_t most_waiting = 16;
  stopped_ = Clock::now();
  wanted_.clear();
  drivers_.forget();
  if (stops_.size() < most_waiting) stops_.push_back(std::move(done));
  if (!stopping_) repeat_stop();
}

// Repeats until confirmed, so that the board is also stopped after an outage.
void BoardCommands::repeat_stop() {
  stopping_ = true;
  board_.async_send(Command::stop(), stop_patience, [this](const CommandResult& result) {
    stopping_ = false;
    in_words(board_, Command::stop(), [this](bool stopped, const std::string& text) {
      warn(stopped ? text : fmt::format("{}; {}", text, stop_last_resort));
      for (const Done& each : std::exchange(stops_, {})) each(stopped, text);
    })(result);
    if (result.outcome == Outcome::timed_out) repeat_stop();
  });
}

void BoardCommands::arm_at_first() {
  if (stopped_ == Clock::time_point{}) return arm([](bool, const std::string&) {});
  warn("--arm: a stop came first; arm the board when the danger is over");
}

bool BoardCommands::is_without_link(const std::string& what, const Done& done) const {
  const LinkStatus& link = board_.link();
  if (link.in_control) return false;
  const std::string text = explain(what, link).text();
  warn(text);
  done(false, text);
  return true;
}

AsyncBoard::Duration BoardCommands::left_of(const Origin& origin) {
  const auto age = std::chrono::ceil<std::chrono::milliseconds>(Clock::now() - origin.written);
  return std::max<AsyncBoard::Duration>(oldest - age, 1ms);
}

void BoardCommands::clear(const Origin& origin, Done done) {
  if (is_without_link("E:CLEAR", done)) return;
  board_.async_send(Command::clear(), left_of(origin),
                    in_words(board_, Command::clear(), std::move(done)));
}

void BoardCommands::arm(Done done) {
  if (is_without_link("arm", done)) return;
  if (arming_) {
    done(false, "arm: the board is already being armed");
    return;
  }
  arming_ = true;
  board_.async_arm(arm_patience,
                   asio::bind_cancellation_slot(give_up_arming_.slot(),
                                                in_words(board_, "arm",
                                                         [this, done = std::move(done)](
                                                             bool armed, const std::string& text) {
                                                           arming_ = false;
                                                           if (!armed) warn(text);
                                                           done(armed, text);
                                                         })));
}

void BoardCommands::send(const std::optional<std::string>& text, const void* source,
                         const Origin& origin, const Done& done) {
  if (!text) {
    done(false,
         "~/send: the text is not a valid command; write commands such as O:358,1,1;S:1500,3");
    return;
  }
  if (asks_to_stop(*text)) {
    stop(done);
    return;
  }
  try {
    const std::vector<OwnCommand> commands = commands_of(*text);
    const LinkStatus& link = board_.link();
    if (!link.in_control) {
      done(false, explain(*text, link).text());
      return;
    }
    post_wanted();
    // Repeated until the command is too old.
    const auto left = left_of(origin);
    if (commands.size() == 1 && !joins_groups(Command(commands[0]).kind)) {
      const Command command = commands[0];
      if (command.kind == CommandKind::clear && is_overtaken(origin)) {
        return done(false, *text + overtaken);
      }
      return board_.async_send(command, left, in_words(board_, commands[0], done));
    }
    Setpoints setpoints;
    for (const OwnCommand& own : commands) {
      const Command command = own;
      if (const std::string objection = objection_to(command); !objection.empty()) {
        return done(false, objection);
      }
      setpoints.add(command);
    }
    const auto in_text = in_words(board_, setpoints, done);
    board_.async_send(setpoints, left, [this, commands, in_text](const CommandResult& result) {
      for (const OwnCommand& own : commands) drivers_.on_number(own, result.pnum);
      in_text(result);
    });
    if (board_.disarmed_by() != DisarmCause::none) return;
    for (const OwnCommand& own : commands) {
      drivers_.on_sent(own, source, origin.publisher, BootClock::now());
    }
  } catch (const Error& error) {
    done(false, error.problem().text());
  }
}

}  // namespace r4::tool::ros2
