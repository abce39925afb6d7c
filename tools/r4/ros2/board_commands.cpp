// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_commands.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "command_text.hpp"
#include "host/commands/command_help.hpp"
#include "r4link/error.hpp"

namespace r4::tool::ros2 {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t most_texts = 16;  // of R4_Command, that wait
constexpr std::size_t most_others = 4;  // in one turn

// The same output?
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
  if (options_.drive) subscribe_drive(graph, node, inbox);
  serve_all(graph, node, inbox);
  board_.on_state([this](const ReceivedState& state, const Datagram&) {
    drivers_.on_state(state, BootClock::now() - (Clock::now() - state.sampled));
  });
  board_.on_arming([this](DisarmCause cause) {
    if (cause == DisarmCause::none) return;
    // Without the motors' supply the board is not safe yet, and takes nothing but a stop from us now.
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

// NOLINTBEGIN(clang-analyzer-cplusplus.NewDeleteLeaks): it loses sight of a std::function that is moved from a
// designated initializer.

// --- topics

template <class Message, class Value>
void BoardCommands::add(Inbox& inbox, const std::string& topic,
                        Inbox::Subscription<Message, Value> subscription) {
  subscription.left = on_publishers(topic, std::move(subscription.left));
  subscription.mismatched = [this, topic](const char* policy) {
    warn(
        fmt::format("{}: a publisher does not offer what this subscription needs, {}, and is not "
                    "heard; have it do so, as ROS does by default",
                    topic, policy));
  };
  inbox.add(std::move(subscription));
}

// Of who publishes reliably twice: a stop is a stop. Who does not, a micro-ROS button for one, is heard, too.
void BoardCommands::subscribe_stop(Graph& graph, std::size_t node, Inbox& inbox) {
  const auto subscribe = [&](bool reliable) {
    Qos qos;
    qos.reliable = reliable;
    Inbox::Subscription<BoolMessage, bool> stops{
        .reader = graph.subscribe<BoolMessage>(node, "stop", qos),
        .room = 1,
        .read = [](const BoolMessage& message) { return std::optional(message.data != 0); },
        .urgent = [](bool pressed) { return pressed; },
        .take =
            [this](bool pressed, const Origin&) {
              if (pressed) stop([](bool, const std::string&) {});
            },
        .left = {},
        .mismatched = {},
    };
    reliable ? inbox.add(std::move(stops)) : add(inbox, "stop", std::move(stops));
  };
  subscribe(true);
  subscribe(false);
}

void BoardCommands::subscribe_arm(Graph& graph, std::size_t node, Inbox& inbox) {
  Qos qos;
  qos.depth = 10;
  add<BoolMessage, bool>(
      inbox, "arm",
      {
          .reader = graph.subscribe<BoolMessage>(node, "arm", qos),
          .room = 8,
          .read = [](const BoolMessage& message) { return std::optional(message.data == 1); },
          .urgent = {},
          .take =
              [this](bool pressed, const Origin& origin) {
                if (origin.writer == EntityId{}) {  // it may have been pressed all along
                  if (!pressed) return;
                  return warn("arm: dropped: its publisher has gone; let it stay for a second");
                }
                // Who repeats itself does not arm again what has been stopped since: the edge counts.
                const bool edge = pressed_.on(origin.writer, pressed);
                if (!edge || is_stale("arm", origin)) return;
                if (is_overtaken(origin)) {
                  warn("arm: a stop came after it; arm again when the danger is over");
                } else {
                  arm([](bool, const std::string&) {});
                }
              },
          .left = {},
          .mismatched = {},
      });
}

void BoardCommands::subscribe_text(Graph& graph, std::size_t node, Inbox& inbox) {
  Qos qos;
  qos.depth = static_cast<int>(most_texts);  // each may be for another channel
  const void* const source = sources_.emplace_back(std::make_unique<int>()).get();
  add<StringMessage, std::string>(
      inbox, "R4_Command",
      {
          .reader = graph.subscribe<StringMessage>(node, "R4_Command", qos),
          .room = most_texts,
          .read = [](const StringMessage& message) { return text_of(bytes_of(message.data)); },
          .urgent = [](const std::string& text) { return asks_to_stop(text); },
          .take = [this, source](const std::string& text,
                                 const Origin& origin) { on_text(text, source, origin); },
          .left = [this, source](const auto& there) { drivers_.on_publishers(source, there); },
          .mismatched = {},
      });
}

void BoardCommands::on_text(const std::string& text, const void* source, const Origin& origin) {
  if (asks_to_stop(text)) {
    stop([](bool, const std::string&) {});
    return;
  }
  if (is_stale("R4_Command", origin)) return;
  std::vector<Command> commands;
  try {
    commands = commands_of(text);
    for (const Command& command : commands) board_.require_sendable(command);
  } catch (const Error& error) {
    warn(error.problem().text());
    return;
  }
  for (const Command& command : commands) {
    if (const std::string objection = objection_to(command); !objection.empty()) {
      warn(objection);
      return;
    }
  }
  for (const Command& command : commands) {
    if (joins_groups(command.kind)) {
      want(command, source, origin);
    } else if (command.kind == CommandKind::clear) {
      if (is_overtaken(origin)) {
        warn("E:CLEAR: a stop came after it; send it again when the danger is over");
      } else {
        clear(origin, [](bool, const std::string&) {});
      }
    } else if (others_ < most_others) {
      ++others_;
      post_wanted();  // a transfer goes alone, behind what came before it
      if (const PostResult result = board_.post(command); !result) tell(shown(command), result);
    } else {
      warn(fmt::format("a command was dropped: more than {} at once that drive no output ({})",
                       most_others, shown(command)));
    }
  }
}

template <class Message, class ToCommand>
void BoardCommands::subscribe_output(Graph& graph, std::size_t node, Inbox& inbox,
                                     const std::string& topic, ToCommand to_command) {
  Qos qos;
  qos.depth = 1;
  const void* const source = sources_.emplace_back(std::make_unique<int>()).get();
  add<Message, double>(
      inbox, topic,
      {
          .reader = graph.subscribe<Message>(node, topic, qos),
          .room = 1,
          .read =
              [](const Message& message) {
                return std::optional(static_cast<double>(message.data));
              },
          .urgent = {},
          .take =
              [this, source, topic, to_command](double value, const Origin& origin) {
                if (is_stale(topic, origin)) return;
                const std::optional<Command> command = to_command(value);
                if (command) {
                  want(*command, source, origin);
                } else {
                  warn(fmt::format("{}: {} is out of range; it changes nothing", topic, value));
                }
              },
          .left = [this, source](const auto& there) { drivers_.on_publishers(source, there); },
          .mismatched = {},
      });
}

void BoardCommands::subscribe_outputs(Graph& graph, std::size_t node, Inbox& inbox) {
  const auto subscribe = [&](auto message, const std::string& topic, auto to_command) {
    subscribe_output<decltype(message)>(graph, node, inbox, topic, to_command);
  };
  for (int n = 1; n <= osmc_channels; ++n) {
    const auto motor = [&](CommandKind kind, const std::string& topic) {
      subscribe(Float32Message(), topic, [channel = MotorChannel{kind, n, false}](double duty) {
        return channel.command(duty);
      });
    };
    motor(CommandKind::osmc, fmt::format("osmc{}/command", n));
    motor(CommandKind::dhb12, fmt::format("dhb12_{}/command", n));
    subscribe(Float32Message(), fmt::format("bldc{}/command", n),
              [n](double duty) -> std::optional<Command> {
                const auto speed = from_duty(duty);
                if (!speed) return std::nullopt;
                return Command::bldc(speed->pwm, speed->direction, speed->pwm == 0, n);
              });
    subscribe(Int32Message(), fmt::format("stepper{}/command", n), [n](double steps) {
      return std::optional(
          Command::stepper(static_cast<std::int32_t>(steps), stepper_speed_default, n));
    });
  }
  for (int n = 1; n <= servo_channels; ++n) {
    subscribe(Float32Message(), fmt::format("servo{}/command", n),
              [n, servo = options_.servo](double value) -> std::optional<Command> {
                const auto pulse = to_pulse(servo, value);
                if (!pulse) return std::nullopt;
                return Command::servo(*pulse, n);
              });
  }
  for (int n = 2; n <= relay_channels; ++n) {  // relay 1 is arming's
    subscribe(BoolMessage(), fmt::format("relay{}/command", n), [n](double on) {
      return on == 0 || on == 1 ? std::optional(Command::relay(n, on == 1)) : std::nullopt;
    });
  }
}

void BoardCommands::subscribe_drive(Graph& graph, std::size_t node, Inbox& inbox) {
  struct Speed {
    double linear;
    double angular;
  };
  Qos qos;
  qos.depth = 1;
  const void* const source = sources_.emplace_back(std::make_unique<int>()).get();
  add<TwistMessage, Speed>(
      inbox, "cmd_vel",
      {
          .reader = graph.subscribe<TwistMessage>(node, "cmd_vel", qos),
          .room = 1,
          .read =
              [](const TwistMessage& message) {
                return std::optional(Speed{message.linear.x, message.angular.z});
              },
          .urgent = {},
          .take =
              [this, source](const Speed& speed, const Origin& origin) {
                if (is_stale("cmd_vel", origin)) return;
                const auto setpoints = options_.drive->setpoints(speed.linear, speed.angular);
                if (!setpoints) {
                  warn("cmd_vel: a speed is no number; it changes nothing");
                  return;
                }
                for (std::size_t i = 0; i < setpoints->size(); ++i) {
                  want((*setpoints)[i], source, origin);
                }
              },
          .left = [this, source](const auto& there) { drivers_.on_publishers(source, there); },
          .mismatched = {},
      });
}

// NOLINTEND(clang-analyzer-cplusplus.NewDeleteLeaks)

// --- setpoints

BoardCommands::Left BoardCommands::on_publishers(const std::string& topic, Left left) {
  return [this, topic, left = std::move(left)](const std::vector<std::uint64_t>& there) {
    say_(LogLevel::info, fmt::format("{}: {} publishers", topic, there.size()));
    post_wanted();  // what they said last goes out before they are missed
    if (left) left(there);
  };
}

bool BoardCommands::is_stale(const std::string& what, const Origin& origin) {
  if (Clock::now() - origin.written <= oldest) return false;
  ++stale_;
  warn(
      fmt::format("{}: dropped: it was more than {} ms on its way; see what the network or this "
                  "computer is busy with, and that the clocks of both computers go alike",
                  what, oldest.count()));
  return true;
}

std::string BoardCommands::objection_to(const Command& command) const {
  if (command.kind != CommandKind::stepper ||
      options_.fields.has(position_of(static_cast<int>(command.channel)))) {
    return {};
  }
  return fmt::format(
      "{}: the board is not asked where that stepper is, so that nobody could stop it; add "
      "STEP{}POS to --fields",
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
  std::string what = text_of(wanted_[first].command);
  if (count == 1) {
    result = board_.post(wanted_[first].command);
  } else {
    Setpoints group;
    for (std::size_t i = first; i < first + count; ++i) group.add(wanted_[i].command);
    what = text_of(group);
    result = board_.post(group);
  }
  if (!result) tell(what, result);
  const Drivers::Time now = BootClock::now();
  for (std::size_t i = first; i < first + count; ++i) {
    const Setpoint& each = wanted_[i];
    // What is to rest is repeated until it does, also if it could not be sent.
    if (!result && !Drivers::rests(each.command)) continue;
    drivers_.on_sent(each.command, each.source, each.publisher, now);
  }
}

void BoardCommands::tell(const std::string& what, PostResult result) {
  if (result == PostResult::not_armed) {
    const DisarmCause cause = board_.disarmed_by();
    const Problem problem = for_a_node(explain("command", cause), cause);
    warn(fmt::format("not armed ({}): {}", to_text(cause), problem.fix));
  } else {
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
    warn(fmt::format("{}: whoever drove it has gone or is silent", text_of(group)));
  }
  resting_ = true;
  board_.async_apply(group, oldest, [this, stop](const CommandResult& result) {
    resting_ = false;
    if (result.outcome == Outcome::confirmed) drivers_.stopped(stop);
  });
}

}  // namespace r4::tool::ros2
