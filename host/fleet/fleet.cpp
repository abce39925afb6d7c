// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/fleet.hpp"

#include <utility>
#include <variant>

#include "../../transports/file_descriptor.hpp"
#include "../commands/command_help.hpp"
#include "../commands/limits.hpp"
#include "fleet_impl.hpp"
#include "r4link/commands/command_text.hpp"

namespace r4 {

bool FleetResults::all_confirmed() const { return failed().empty(); }

std::vector<std::size_t> FleetResults::failed() const {
  std::vector<std::size_t> boards;
  for (const FleetResult& each : results_) {
    if (!each.confirmed()) boards.push_back(each.board);
  }
  return boards;
}

void FleetResults::require() const {
  const auto first =
      std::find_if_not(results_.begin(), results_.end(), std::mem_fn(&FleetResult::confirmed));
  if (first == results_.end()) return;
  Problem problem = first->problem;
  const std::size_t others = failed().size() - 1;
  if (others != 0) problem.reason += " (and " + std::to_string(others) + " other boards)";
  throw Error(std::move(problem));
}

Fleet::Fleet(const std::vector<std::string>& patterns, BoardOptions options)
    : impl_(with_system_errors("a fleet", [&] {
        require_watches();
        return std::make_unique<Impl>(patterns, std::move(options));
      })) {}
Fleet::~Fleet() = default;
void Fleet::close() { impl_->close(); }

std::size_t Fleet::size() const { return impl_->boards.size(); }
const std::string& Fleet::url(std::size_t board) const {
  impl_->require_board(board);
  return impl_->urls[board];
}

std::size_t Fleet::find(std::string_view url_or_name) const {
  Boards found;
  for (std::size_t i = 0; i < size(); ++i) {
    if (impl_->urls[i] == url_or_name) return i;
  }
  impl_->run_on_loop("find()", [&] {
    for (std::size_t i = 0; i < size(); ++i) {
      const BoardIdentity& identity = impl_->boards[i]->identity();
      if (url_or_name.empty()) continue;
      if (identity.name == url_or_name || identity.board_id == url_or_name) found.push_back(i);
    }
  });
  if (found.size() == 1) return found.front();
  if (found.empty()) {
    throw Error(ErrorKind::usage, std::string(url_or_name),
                "a board of this name is not in the fleet",
                "use the URL of the board; a board's name is known after its first answer");
  }
  throw Error(ErrorKind::usage, std::string(url_or_name),
              std::to_string(found.size()) + " boards of the fleet have this name",
              "use the URL of the board");
}

FleetBoard Fleet::operator[](std::size_t board) {
  impl_->require_board(board);
  return FleetBoard(*this, board);
}
FleetBoard Fleet::operator[](std::string_view url_or_name) {
  return FleetBoard(*this, find(url_or_name));
}

Fleet::Boards Fleet::wait_active(Duration timeout) {
  require_wait("wait_active()", timeout);
  return impl_->wait_active(impl_->all_boards, timeout);
}

std::vector<BoardHealth> Fleet::health() const {
  std::vector<BoardHealth> all(size());
  impl_->run_on_loop("health()", [&] {
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = impl_->health_of(i);
  });
  return all;
}

std::vector<ReceivedState> Fleet::states() const {
  std::vector<ReceivedState> all(size());
  impl_->run_on_loop("states()", [&] {
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = impl_->boards[i]->state();
  });
  return all;
}

FleetResults Fleet::send(const Boards& boards, const Command& command, Duration timeout) {
  require_valid(command);
  require_control(impl_->role, command);
  if (command.kind == CommandKind::stop) return impl_->stop(boards, timeout);
  require_timeout(shown(command), timeout);
  return impl_->execute(shown(command), boards, timeout, Impl::start_of(OwnCommand(command)),
                        why_of(command));
}
FleetResults Fleet::send(const Command& command, Duration timeout) {
  return send(impl_->all_boards, command, timeout);
}
FleetResults Fleet::send(const Boards& boards, std::string_view text, Duration timeout) {
  const CommandOrGroup what = parse_text(text);
  if (const auto* command = std::get_if<OwnCommand>(&what)) return send(boards, *command, timeout);
  std::vector<BoardSetpoints> setpoints;
  setpoints.reserve(boards.size());
  for (const std::size_t board : boards) setpoints.push_back({board, std::get<Setpoints>(what)});
  return send(setpoints, timeout);
}
FleetResults Fleet::send(std::string_view text, Duration timeout) {
  return send(impl_->all_boards, text, timeout);
}

FleetResults Fleet::arm(const Boards& boards, Duration timeout) {
  require_timeout("arm()", timeout);
  require_control(impl_->role, "arm()");
  const auto arm = [](AsyncBoard& board, std::size_t, Duration left, auto end) {
    board.async_arm(left, std::move(end));
  };
  return impl_->execute("arm()", boards, timeout, arm, why_of("arm()"));
}
FleetResults Fleet::arm(Duration timeout) { return arm(impl_->all_boards, timeout); }

FleetResults Fleet::stop(Duration timeout) { return impl_->stop(impl_->all_boards, timeout); }
void Fleet::stop_async() { impl_->stop_async(impl_->all_boards); }

FleetResults Fleet::send(const std::vector<BoardSetpoints>& setpoints, Duration timeout) {
  Boards boards;
  for (const BoardSetpoints& each : setpoints) {
    require_any(each.setpoints);
    boards.push_back(each.board);
  }
  require_timeout("send()", timeout);
  require_control(impl_->role, "send()");
  const auto start = [setpoints](AsyncBoard& board, std::size_t part, Duration left, auto end) {
    board.async_send(setpoints[part].setpoints, left, std::move(end));
  };
  const auto why = [&](std::size_t part, const CommandResult& result, const LinkStatus& link) {
    return explain(setpoints[part].setpoints, result, link);
  };
  return impl_->execute("send()", boards, timeout, start, why);
}

std::vector<PostResult> Fleet::post(const std::vector<BoardSetpoints>& setpoints) {
  for (const BoardSetpoints& each : setpoints) {
    impl_->require_board(each.board);
    require_any(each.setpoints);
  }
  require_control(impl_->role, "post()");
  std::vector<PostResult> results(setpoints.size(), PostResult::no_link);
  impl_->run_on_loop("post()", [&] {
    for (std::size_t i = 0; i < setpoints.size(); ++i) {
      results[i] = impl_->boards[setpoints[i].board]->post(setpoints[i].setpoints);
    }
  });
  return results;
}

std::optional<FleetEvent> Fleet::next_event(Duration timeout) {
  require_wait("next_event()", timeout);
  return impl_->next_event(timeout);
}

void Fleet::record(Recording& recording) {
  impl_->run_on_loop("record()", [&] {
    for (const auto& board : impl_->boards) board->record(recording);
  });
}

void Fleet::watchdog(Duration period) {
  require_watchdog(period);
  impl_->run_on_loop("watchdog()", [&] {
    for (const auto& board : impl_->boards) board->watchdog(period);
  });
}
void Fleet::feed() {
  for (const auto& board : impl_->boards) board->feed();
}

void FleetBoard::send(const Command& command, Duration timeout) {
  fleet_->send({board_}, command, timeout).require();
}
void FleetBoard::send(const Setpoints& setpoints, Duration timeout) {
  fleet_->send({{board_, setpoints}}, timeout).require();
}
void FleetBoard::send(std::string_view text, Duration timeout) {
  fleet_->send({board_}, text, timeout).require();
}
PostResult FleetBoard::post(const Setpoints& setpoints) {
  return fleet_->post({{board_, setpoints}}).front();
}
void FleetBoard::arm(Duration timeout) { fleet_->arm({board_}, timeout).require(); }
void FleetBoard::stop(Duration timeout) { send(Command::stop(), timeout); }
BoardIdentity FleetBoard::identify(Duration timeout) {
  send(Command::identify(), timeout);
  return health().identity;
}
void FleetBoard::wait_active(Duration timeout) {
  require_wait("wait_active()", timeout);
  if (fleet_->impl_->wait_active({board_}, timeout).empty()) return;
  throw Error(explain(url(), health().link));
}

ReceivedState FleetBoard::state() const {
  ReceivedState state;
  fleet_->impl_->run_on_loop("state()", [&] { state = fleet_->impl_->boards[board_]->state(); });
  return state;
}
BoardHealth FleetBoard::health() const {
  BoardHealth health;
  fleet_->impl_->run_on_loop("health()", [&] { health = fleet_->impl_->health_of(board_); });
  return health;
}

}  // namespace r4
