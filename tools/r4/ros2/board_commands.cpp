// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_commands.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "command_text.hpp"
#include "r4link/commands/command_text.hpp"
#include "r4link/error.hpp"
#include "r4link/tables/state_fields.hpp"

namespace r4::tool::ros2 {
namespace {

using namespace std::chrono_literals;

bool is_same_output(const Command& a, const Command& b) {
  return a.kind == b.kind && a.channel == b.channel;
}

}  // namespace

BoardCommands::BoardCommands(AsyncBoard& board, Graph& graph, std::size_t node, Inbox& inbox,
                             Outbox& outbox, const NodeOptions& options, Say say)
    : board_(board),
      outbox_(outbox),
      options_(options),
      say_(std::move(say)),
      drivers_(options.deadline) {
  subscribe_stop(graph, node, inbox);
  subscribe_text(graph, node, inbox);
  subscribe_arm(graph, node, inbox);
  subscribe_outputs(graph, node, inbox);
  if (options_.drive) {
    subscribe_drive(graph, node, inbox);
  } else {
    decline(graph, node, "cmd_vel", Mismatch::Weight::warning,  // another node may receive it
            "the motors of the wheels are not known; start r4 ros2 with --drive, such as --drive "
            "osmc1,-osmc2");
  }
  decline(graph, node, "relay1/command", Mismatch::Weight::lost,
          "relay 1 is the motors' supply, and closes when the board is armed");
  serve_all(graph, node, inbox);
  board_.on_state([this](const ReceivedState& state, const Datagram&) {
    drivers_.on_state(state, BootClock::now() - (Clock::now() - state.sampled));
  });
  board_.on_arming([this](DisarmCause cause) {
    if (cause == DisarmCause::none) return;
    // Without the motors' supply the board accepts only a stop, but is not safe yet.
    if (cause == DisarmCause::supply && drivers_.any()) stop([](bool, const std::string&) {});
    wanted_.clear();
    drivers_.forget();
  });
  board_.on_link([this](const LinkStatus& link) {
    if (arming_ && !link.in_control) give_up_arming_.emit(asio::cancellation_type::terminal);
  });
  board_.on_refused([this](const RefusedPost& refused) {
    const std::string what = shown(refused.command);
    warn(refused.code == Refusal::none
             ? fmt::format("{}: not sent: {}", what, to_text(refused.why))
             : fmt::format("{}: refused by the board: {}", what, meaning_of(refused.code)));
    if (refused.code == Refusal::unknown) drivers_.forget(refused.command);
  });
}

BoardCommands::Left BoardCommands::on_publishers(const std::string& topic, Left left) {
  return [this, topic, left = std::move(left)](const std::vector<std::uint64_t>& there) {
    say_(LogLevel::info, fmt::format("{}: {} publishers", topic, there.size()));
    post_wanted();  // sends the last commands of a publisher before it counts as missing
    if (left) left(there);
  };
}

bool BoardCommands::is_stale(const std::string& what, const Origin& origin) {
  if (Clock::now() - origin.written <= oldest) return false;
  ++stale_;
  warn(
      fmt::format("{}: dropped: the message took more than {} ms to arrive; check the load of the "
                  "network and of this computer, and that the clocks of both computers agree",
                  what, oldest.count()));
  return true;
}

std::string BoardCommands::objection_to(const Command& command) const {
  if (command.kind != CommandKind::stepper ||
      options_.fields.has(state_field(FieldKind::stepper, command.channel))) {
    return {};
  }
  return fmt::format(
      "{}: not sent: the board does not report the stepper's position, so r4 ros2 could not stop "
      "the stepper; add STEP{}POS to --fields",
      shown(command), command.channel);
}

void BoardCommands::want(const Command& command, const void* source, const Origin& origin) {
  if (const std::string objection = objection_to(command); !objection.empty()) {
    warn(objection);
    return;
  }
  std::erase_if(wanted_,
                [&command](const Setpoint& each) { return is_same_output(each.command, command); });
  wanted_.push_back({command, source, origin.publisher});
}

void BoardCommands::flush() {
  others_ = 0;
  post_wanted();
}

void BoardCommands::post_wanted() {
  for (std::size_t first = 0; first < wanted_.size(); first += max_group) {
    post(first, std::min<std::size_t>(max_group, wanted_.size() - first));
  }
  wanted_.clear();
}

void BoardCommands::post(std::size_t first, std::size_t count) {
  PostResult result = PostResult::no_link;
  std::string what = to_text(wanted_[first].command);
  if (count == 1) {
    result = board_.post(wanted_[first].command);
  } else {
    Setpoints group;
    for (std::size_t i = first; i < first + count; ++i) group.add(wanted_[i].command);
    what = to_text(group);
    result = board_.post(group);
  }
  if (!result) tell(what, result);
  const Drivers::Time now = BootClock::now();
  for (std::size_t i = first; i < first + count; ++i) {
    const Setpoint& each = wanted_[i];
    // A stop is repeated until the output rests, even if it could not be sent. For a board without
    // groups, Z may have been sent, although a later command could not be sent.
    const bool zero = each.command.kind == CommandKind::zero;
    if (!result && !zero && !Drivers::rests(each.command)) continue;
    drivers_.on_sent(each.command, each.source, each.publisher, now);
    drivers_.on_number(each.command, result.pnum());
  }
}

void BoardCommands::tell(const std::string& what, PostResult result) {
  if (result == PostResult::not_armed) {
    const DisarmCause cause = board_.disarmed_by();
    const Problem problem = for_a_node(explain("command", cause), cause);
    warn(fmt::format("not armed ({}): {}", to_text(cause), problem.fix));
  } else {
    ++dropped_;
    warn(fmt::format("a command was dropped: {} ({})", to_text(result), what));
  }
}

void BoardCommands::on_tick() {
  if (resting_ || !drivers_.any()) return;
  const Drivers::Stop stop = drivers_.to_stop(BootClock::now());
  if (stop.commands.empty()) return;
  Setpoints group;
  for (const Command& command : stop.commands) group.add(command);
  if (stop.missed) {
    warn(fmt::format("{}: the publisher of the commands has disappeared or is silent",
                     to_text(group)));
  }
  resting_ = true;
  board_.async_send(group, oldest, [this, stop](const CommandResult& result) {
    resting_ = false;
    if (result.outcome == Outcome::confirmed) drivers_.stopped(stop);
  });
}

}  // namespace r4::tool::ros2
