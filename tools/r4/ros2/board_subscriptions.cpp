// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <utility>

#include "board_commands.hpp"
#include "command_text.hpp"
#include "r4link/commands/command_text.hpp"
#include "r4link/error.hpp"

namespace r4::tool::ros2 {
namespace {

constexpr std::size_t most_texts = 16;  // waiting R4_Command texts
constexpr std::size_t most_others = 4;

}  // namespace

// NOLINTBEGIN(clang-analyzer-cplusplus.NewDeleteLeaks): does not follow a std::function that is
// moved from a designated initializer.

// Subscribes twice, reliable and best effort. A duplicate stop is harmless, and no stop is missed.
void BoardCommands::subscribe_stop(Graph& graph, std::size_t node, Inbox& inbox) {
  for (const bool reliable : {true, false}) {
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
    };
    reliable ? inbox.add(std::move(stops)) : add(inbox, "stop", std::move(stops));
  }
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
                if (origin.writer == EntityId{}) {  // the button may have been pressed before
                  if (!pressed) return;
                  return warn(
                      "arm: dropped: the publisher has disappeared; keep it alive for a second");
                }
                // Repeated presses must not arm again after a stop.
                const bool edge = pressed_.on(origin.writer, pressed);
                if (!edge || is_stale("arm", origin)) return;
                if (is_overtaken(origin)) {
                  warn("arm: a stop came after this message; arm again when the danger is over");
                } else {
                  arm([](bool, const std::string&) {});
                }
              },
          .left = {},
      });
}

void BoardCommands::subscribe_text(Graph& graph, std::size_t node, Inbox& inbox) {
  Qos qos;
  qos.depth = static_cast<int>(most_texts);
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
      });
}

void BoardCommands::on_text(const std::string& text, const void* source, const Origin& origin) {
  if (asks_to_stop(text)) {
    stop([](bool, const std::string&) {});
    return;
  }
  if (is_stale("R4_Command", origin)) return;
  std::vector<OwnCommand> commands;
  try {
    commands = commands_of(text);
    for (const OwnCommand& own : commands) board_.require_sendable(own);
  } catch (const Error& error) {
    warn(error.problem().text());
    return;
  }
  for (const OwnCommand& own : commands) {
    if (const std::string objection = objection_to(own); !objection.empty()) {
      warn(objection);
      return;
    }
  }
  for (const OwnCommand& own : commands) {
    const Command command = own;
    if (joins_groups(command.kind)) {
      want(command, source, origin);
    } else if (command.kind == CommandKind::clear) {
      if (is_overtaken(origin)) {
        warn("E:CLEAR: a stop came after this command; send E:CLEAR again when the danger is over");
      } else {
        clear(origin, [](bool, const std::string&) {});
      }
    } else if (others_ < most_others) {
      ++others_;
      post_wanted();  // a transfer is sent alone, after earlier commands
      if (const PostResult result = board_.post(command); !result) tell(shown(command), result);
    } else {
      ++dropped_;
      warn(fmt::format(
          "a command was dropped: more than {} commands without an output arrived at once ({})",
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
                  warn(fmt::format("{}: {} is out of range, so the message is ignored", topic,
                                   value));
                }
              },
          .left = [this, source](const auto& there) { drivers_.on_publishers(source, there); },
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
                const Duty speed(duty);
                if (!speed.is_in_range()) return std::nullopt;
                return Command::bldc(n, speed, speed.pwm().value == 0);
              });
    subscribe(Int32Message(), fmt::format("stepper{}/command", n), [n](double steps) {
      return std::optional(Command::stepper(n, Steps(static_cast<std::int32_t>(steps))));
    });
  }
  for (int n = 1; n <= servo_channels; ++n) {
    subscribe(Float32Message(), fmt::format("servo{}/command", n),
              [n, servo = options_.servo](double value) -> std::optional<Command> {
                const auto pulse = to_pulse(servo, value);
                if (!pulse) return std::nullopt;
                return Command::servo(n, *pulse);
              });
  }
  for (int n = 2; n <= relay_channels; ++n) {  // relay 1 is reserved for arming
    subscribe(BoolMessage(), fmt::format("relay{}/command", n), [n](double on) {
      return on == 0 || on == 1 ? std::optional(Command::relay(n, on == 1)) : std::nullopt;
    });
  }
}

template <class Message, class Read>
void BoardCommands::subscribe_speed(Graph& graph, std::size_t node, Inbox& inbox,
                                    const void* source, Read read) {
  Qos qos;
  qos.depth = 1;
  add<Message, Speed>(
      inbox, "cmd_vel",
      {
          .reader = graph.subscribe<Message>(node, "cmd_vel", qos),
          .room = 1,
          .read = [read](const Message& message) { return std::optional<Speed>(read(message)); },
          .urgent = {},
          .take = [this, source](const Speed& speed,
                                 const Origin& origin) { on_speed(speed, source, origin); },
          .left = [this, source](const auto& there) { drivers_.on_publishers(source, there); },
      });
}

void BoardCommands::subscribe_drive(Graph& graph, std::size_t node, Inbox& inbox) {
  const void* const source = sources_.emplace_back(std::make_unique<int>()).get();
  const void* const stamped_source = sources_.emplace_back(std::make_unique<int>()).get();
  subscribe_speed<TwistMessage>(graph, node, inbox, source, [](const TwistMessage& twist) {
    return Speed{twist.linear.x, twist.angular.z, {}};
  });
  // `ros2 topic echo` cannot show a topic of two types, so this type is subscribed on demand.
  const auto subscribe_stamped = [this, &graph, node, &inbox, stamped_source] {
    subscribe_speed<TwistStampedMessage>(
        graph, node, inbox, stamped_source, [](const TwistStampedMessage& message) {
          return Speed{message.twist.linear.x, message.twist.angular.z,
                       stamp_time(message.header.stamp.sec, message.header.stamp.nanosec)};
        });
  };
  graph.on_other_type(
      node, "cmd_vel",
      [subscribe_stamped,
       taken = false](const Announced& writer) mutable -> std::optional<Mismatch> {
        const MessageType& stamped = message_type<TwistStampedMessage>();
        if (writer.type != stamped.descriptor->m_typename) return std::nullopt;
        if (!std::exchange(taken, true)) subscribe_stamped();
        return Mismatch{
            Mismatch::Weight::note,
            fmt::format("cmd_vel: a publisher ({}) has the type {}, which is also accepted",
                        writer.owner_text(), stamped.name)};
      });
}

void BoardCommands::on_speed(const Speed& speed, const void* source, const Origin& origin) {
  if (is_stale("cmd_vel", origin)) return;
  if (options_.one_clock &&
      is_outdated(speed.stamp, std::chrono::system_clock::now(), options_.deadline)) {
    ++stale_;
    return warn(
        fmt::format("cmd_vel: dropped: the stamp of the header is more than {} ms old; use the "
                    "time of this computer, or 0, as the stamp",
                    options_.deadline.count()));
  }
  const auto setpoints = options_.drive->setpoints(speed.linear, speed.angular);
  if (!setpoints) return warn("cmd_vel: a speed is not a number, so the message is ignored");
  for (std::size_t i = 0; i < setpoints->size(); ++i) want((*setpoints)[i], source, origin);
}

// Warns about topics that ROS users often publish but that would have no effect.
void BoardCommands::decline(Graph& graph, std::size_t node, const char* topic,
                            Mismatch::Weight weight, const char* why) {
  graph.on_other_type(node, topic, [topic, weight, why](const Announced& writer) {
    return Mismatch{weight, fmt::format("{}: a publisher ({}) is not received: {}", topic,
                                        writer.owner_text(), why)};
  });
}

// NOLINTEND(clang-analyzer-cplusplus.NewDeleteLeaks)

}  // namespace r4::tool::ros2
