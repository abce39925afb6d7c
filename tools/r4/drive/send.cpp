// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "../boards/board_set.hpp"
#include "../boards/paths.hpp"
#include "../shell/help.hpp"
#include "../shell/json.hpp"
#include "../shell/key_file.hpp"
#include "../shell/number.hpp"
#include "../shell/options.hpp"
#include "../shell/subcommands.hpp"
#include "r4link/async_board.hpp"
#include "r4link/commands/command_text.hpp"
#include "r4link/error.hpp"
#include "r4link/link.hpp"
#include "r4link/setpoints.hpp"

namespace r4::tool {
namespace {

struct SendOptions {
  std::string url;
  std::vector<std::string> commands;
  Milliseconds timeout{3000};
  Milliseconds hold{0};
  std::string key;
  bool json = false;
};

using Order = CommandOrGroup;

std::string shown(const Order& order) {
  return std::visit([](const auto& each) { return r4::shown(each); }, order);
}

std::optional<Command> command_of(const Order& order) {
  const auto* const own = std::get_if<OwnCommand>(&order);
  return own == nullptr ? std::nullopt : std::optional<Command>(*own);
}

bool is(CommandKind kind, const Order& order) {
  const auto command = command_of(order);
  return command && command->kind == kind;
}

// Throws Error{usage} if the command is wrong or not allowed at `url`.
Order order_of(const std::string& text, const std::string& url) {
  Order order = parse_text(text);
  if (is(CommandKind::heartbeat, order)) {
    throw Error(ErrorKind::usage, text, "r4 sends heartbeats itself",
                "use --hold to keep the link up");
  }
  if (const auto command = command_of(order)) require_cable(url, *command);
  return order;
}

bool turns_a_motor(const Command& command) {
#define R4_OUTPUT(output, Value, member, channels, motor) \
  if (command.kind == CommandKind::output) return (motor) && command.value != 0;
#include "r4link/tables/board.def"
  return command.kind == CommandKind::stepper;
}

bool turns_a_motor(const Setpoints& group) {
  for (std::size_t i = 0; i < group.size(); ++i) {
    if (turns_a_motor(group[i])) return true;
  }
  return false;
}

bool needs_motor_supply(const Order& order) {
  return std::visit([](const auto& each) { return turns_a_motor(each); }, order);
}

std::optional<Milliseconds> setting_of(const Order& order, std::string_view key) {
  if (!is(CommandKind::setting, order) || command_of(order)->text != Text(key)) return {};
  const Text value = command_of(order)->text2;
  return Milliseconds(number_in<std::uint32_t>({value.data(), value.size()}).value_or(0));
}

// Both settings are sent in one step, because the board may refuse one setting alone.
struct LinkTiming {
  Milliseconds timeout{0};
  Milliseconds heartbeat{0};
};
std::optional<LinkTiming> link_timing_at(const std::vector<Order>& orders, std::size_t i) {
  if (i + 1 >= orders.size()) return std::nullopt;
  const auto timing = [&](const Order& a, const Order& b) -> std::optional<LinkTiming> {
    const auto timeout = setting_of(a, "timeout");
    const auto heartbeat = setting_of(b, "heartbeat");
    if (!timeout || !heartbeat) return std::nullopt;
    return LinkTiming{*timeout, *heartbeat};
  };
  const auto in_order = timing(orders[i], orders[i + 1]);
  return in_order ? in_order : timing(orders[i + 1], orders[i]);
}

// No arming: a typed command is deliberate. Heartbeats suit the shortest timeout in the commands.
BoardOptions board_options(const SendOptions& options, const std::vector<Order>& orders) {
  BoardOptions board_options = with_key(options.key);
  board_options.session.arming = Arming::off;
  const bool turns = std::any_of(orders.begin(), orders.end(),
                                 [](const Order& o) { return needs_motor_supply(o); });
  if (turns) board_options.session.fields = "DEFAULT,RELAYS";
  for (const Order& order : orders) {
    const auto timeout = setting_of(order, "timeout");
    if (!timeout) continue;
    std::uint32_t& ours = board_options.session.timing.heartbeat_ms;
    ours = std::min(ours, static_cast<std::uint32_t>(timeout->count() / 3));
  }
  return board_options;
}

class Sender {
 public:
  Sender(const SendOptions& options, const std::vector<Order>& orders)
      : options_(options),
        orders_(orders),
        board_(boards_.add(options.url, board_options(options, orders)).board),
        hold_(boards_.io()) {}

  int run() {
    const Subscription refused = board_.on_link([this](const LinkStatus& link) {
      if (link.causes.has(LinkCause::two_boards)) boards_.stop();
    });
    const Subscription events = board_.on_event([this](const CarrierEvent& event) {
      if (event.kind == CarrierEvent::Kind::down) down_ = event.problem;
    });
    for (std::size_t i = 0; i < orders_.size(); ++i) {
      const auto timing = link_timing_at(orders_, i);
      if (!timing) continue;
      board_.require_link_timing(timing->timeout, timing->heartbeat);
      ++i;
    }
    board_.open();
    boards_.end_by_signal();  // so that Ctrl-C sends a farewell: the outputs are off at once
    send_next();
    boards_.run();
    require_one_board(board_);
    const std::vector<PathStatus> paths = board_.paths();
    leaving_ = true;
    hold_.cancel();
    boards_.leave();
    tell_paths_down(paths, options_.json);
    if (failure_) throw Error(*failure_);
    if (next_ != orders_.size()) {
      const bool stop = is(CommandKind::stop, orders_[next_]);
      print_trouble("r4: {} to {}: interrupted before it was confirmed; {}", shown(orders_[next_]),
                    board_.name(),
                    stop ? "cut the power" : "look at the robot: it may have been executed");
    }
    boards_.raise_signal_again();
    return 0;
  }

 private:
  void send_next() {
    if (next_ == orders_.size()) {
      hold_.after(options_.hold, [this] { boards_.stop(); });
      return;
    }
    const auto done = [this](const CommandResult& result) { tell(result); };
    if (const auto timing = link_timing_at(orders_, next_)) {
      board_.async_link_timing(timing->timeout, timing->heartbeat, options_.timeout, done);
    } else if (is_transfer()) {
      board_.async_transfer(*command_of(orders_[next_]), options_.timeout, done);
    } else {
      std::visit([&](const auto& each) { board_.async_send(each, options_.timeout, done); },
                 orders_[next_]);
    }
  }

  bool is_transfer() const {
    const Order& order = orders_[next_];
    return is(CommandKind::i2c_read, order) || is(CommandKind::i2c_write, order) ||
           is(CommandKind::i2c_scan, order);
  }
  void tell(const CommandResult& result) {
    if (leaving_) return;  // boards_.stop() would end the farewell
    const std::size_t size = link_timing_at(orders_, next_) ? 2 : 1;
    std::string text = shown(orders_[next_]);
    if (size == 2) text += " " + shown(orders_[next_ + 1]);
    const bool confirmed = result.outcome == Outcome::confirmed;
    const Problem problem = size == 2 ? explain(text, result, board_.link()) : explain_next(result);
    if (options_.json) {
      print_line(result_json(text, result, problem, confirmed));
    } else if (confirmed) {
      print_text("{}  confirmed in {:.1f} ms{}\n", text, milliseconds(result),
                 next_ == 0 ? ", including connection setup" : "");
      if (is(CommandKind::identify, orders_[next_])) print_identity();
      if (is_transfer()) print_bytes(result.transfer);
    } else {
      print_text("{}  {}\n", text, problem.reason);
    }
    if (!confirmed) {
      for (std::size_t i = next_ + size; i < orders_.size() && !options_.json; ++i) {
        print_text("{}  not sent\n", shown(orders_[i]));
      }
      failure_ = problem;
      failure_->thing = fmt::format("{} to {}", problem.thing, board_.name());
      if (down_ && board_.link().causes.has(LinkCause::transport_down))
        failure_->fix = down_->text();
      boards_.stop();
      return;
    }
    if (supply_is_missing() && !options_.json) {
      print_trouble(
          "r4: {}: the motor supply is open (relay 1 is off), so the motors do not turn; send "
          "R:1,On first",
          text);
    }
    next_ += size;
    send_next();
  }

  Problem explain_next(const CommandResult& result) const {
    return std::visit([&](const auto& each) { return explain(each, result, board_.link()); },
                      orders_[next_]);
  }

  bool supply_is_missing() const {
    const State& state = board_.state();
    return needs_motor_supply(orders_[next_]) && state.present.has(StateField::relays) &&
           (state.relays & 1) == 0;
  }

  // The bytes of a scan are addresses.
  void print_bytes(const I2cAnswer& transfer) const {
    const auto& data = transfer.data;
    if (!is(CommandKind::i2c_scan, orders_[next_])) {
      if (data.size != 0) print_text("  x{:02x}\n", fmt::join(data.begin(), data.end(), ""));
    } else if (data.size == 0) {
      print_text("  no device answers\n");
    } else {
      print_text("  0x{:02x}\n", fmt::join(data.begin(), data.end(), " 0x"));
    }
  }

  void print_identity() const {
    const BoardIdentity& id = board_.identity();
    const std::string name = id.name.empty() ? "" : " (" + id.name + ")";
    print_text("  board {}{}, firmware {}, {}\n", id.board_id, name, id.firmware, id.capabilities);
  }

  static double milliseconds(const CommandResult& result) {
    return std::chrono::duration<double, std::milli>(result.elapsed).count();
  }

  Json result_json(const std::string& text, const CommandResult& result, const Problem& problem,
                   bool confirmed) const {
    Json object{{"type", "result"},
                {"command", text},
                {"confirmed", confirmed},
                {"outcome", to_text(result.outcome)},
                {"ms", milliseconds(result)}};
    if (result.outcome == Outcome::refused) {
      const Text name = name_of(result.code);
      object["code"] = std::string_view(name.data(), name.size());
    }
    if (result.at != 0) {
      object["at"] = result.at;
      object["executed"] = result.executed;
    }
    if (!confirmed) object["reason"] = problem.reason;
    if (confirmed && needs_motor_supply(orders_[next_])) {
      object["motor_supply"] = supply_is_missing() ? "open" : "closed";
    }
    const bool answered = confirmed || result.transfer.outcome != I2cOutcome::done;
    if (is_transfer() && answered) {
      const DeviceBytes<i2c_max_bytes>& data = result.transfer.data;
      object["transfer"] = to_text(result.transfer.outcome);
      object["bytes"] = fmt::format("x{:02x}", fmt::join(data.begin(), data.end(), ""));
    }
    if (confirmed && is(CommandKind::identify, orders_[next_])) {
      const BoardIdentity& id = board_.identity();
      object["board_id"] = id.board_id;
      object["name"] = id.name;
      object["firmware"] = id.firmware;
      object["capabilities"] = id.capabilities;
    }
    return object;
  }

  const SendOptions& options_;
  const std::vector<Order>& orders_;
  BoardSet boards_;
  AsyncBoard& board_;
  Timer hold_;
  bool leaving_ = false;
  std::size_t next_ = 0;
  std::optional<Problem> failure_;
  std::optional<Problem> down_;  // the latest reason why the transport was down
};

int send(const SendOptions& given) {
  SendOptions options = given;
  take_paths(options.url, options.commands, "CMD");
  std::vector<Order> orders;
  for (const std::string& text : options.commands) {
    orders.push_back(order_of(text, options.url));
  }
  return Sender(options, orders).run();
}

constexpr const char* send_footer =
    R"(r4 checks all commands before it sends the first command. Each further command is sent after the board's own
state has confirmed the previous command. If a command is not confirmed, r4 ends. Commands in one argument,
separated by semicolons, are a group: up to 16 commands O D S R P B Z and X:DAC. The board executes a
group completely or not at all.

When r4 ends, also by Ctrl-C, the board goes safe and switches its outputs off: --hold keeps them on. The
motors turn only while relay 1, the motor supply, is closed. It is open at the start and after each safe
state, and R:1,On closes it.

Examples:
  r4 send udp://192.168.0.125 R:1,On O:358,1,1 --hold 5      R:1,On closes the motor supply
  r4 send serial:auto R:1,On D:1000,1,1 S:1500,3 R:2,On --hold 60
  r4 send serial:auto R:1,On 'O:358,1,1;O:358,1,2' --hold 5  both wheels at once
  r4 send serial:auto udp://192.168.0.125 S:1500,3 --hold 60  two paths: one may fail
  r4 send serial:auto E:CLEAR                 after an emergency stop
  r4 send serial:auto C:timeout,300 C:heartbeat,100     next to each other: one step, in any order
  r4 send udp://127.0.0.1 Q:ID                the identity of the board
  r4 send serial:auto X:SCAN                  the devices that answer on the user's I2C bus
  r4 send serial:auto X:READ,0x68,x75,1       register 0x75 of the device at 0x68

Exit codes: 0 all commands were confirmed; 3 a command was refused or not confirmed in time; 2 a command or
option is wrong, and nothing was sent; 4 the transport cannot be opened; 5 permission denied. Ctrl-C ends r4
by the signal: 130 in a shell.)";

}  // namespace

void add_send(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<SendOptions>();
  CLI::App* const command =
      add_subcommand(root, chosen, "send", "Send commands and wait until the board confirms them",
                     "Commands:\n" + command_table() + "\n" + send_footer, options, send);
  add_url(*command, options->url);
  add_texts(*command, "CMD", options->commands,
            "commands, such as O:358,1,1; 'O:358,1,1;O:358,1,2' is a group", "", Need::required);
  add_seconds(*command, "--timeout", options->timeout,
              "how long to wait for each confirmation (default 3)");
  add_seconds(*command, "--hold", options->hold,
              "how long to keep the link up after the last command", Zero::allowed);
  add_key(*command, options->key);
  add_json(*command, options->json, "print JSON, one object a command");
}

}  // namespace r4::tool
