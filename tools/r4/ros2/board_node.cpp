// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_node.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "../boards/paths.hpp"

namespace r4::tool::ros2 {
namespace {

using namespace std::chrono_literals;
using WallClock = std::chrono::system_clock;

constexpr auto tick_period = 20ms;

}  // namespace

BoardNode::BoardNode(asio::io_context& io, AsyncBoard& board, Graph& graph, std::size_t node,
                     Inbox& inbox, Outbox& outbox, const NodeOptions& options, Logged logged)
    : options_(options),
      name_(graph.node(node).full()),
      inbox_(inbox),
      outbox_(outbox),
      logged_(std::move(logged)),
      board_(board),
      topics_(std::make_shared<BoardTopics>(graph, node, options)),
      device_topics_(std::make_shared<DeviceTopics>(graph, node, options.devices)),
      commands_(board_, graph, node, inbox, outbox, options,
                [this](LogLevel level, const std::string& text) { log(level, text); }),
      tick_(io) {
  connect();
  if (options_.devices.empty()) return;
  setup_.emplace(io, board_, options_.devices,
                 [this](const Problem& problem) { log(LogLevel::warning, problem.text()); });
}

void BoardNode::start() {
  outbox_.push([topics = topics_] { topics->on_active(false); });
  tick();
  tick_.every(tick_period, [this] { tick(); });
}

void BoardNode::connect() {
  board_.on_state([this](const ReceivedState& state, const Datagram& datagram) {
    outbox_.push([topics = topics_, devices = device_topics_,
                  state = static_cast<const State&>(state), sampled = state.sampled_at_wall_time(),
                  boot = boots_,
                  line = std::string(datagram.bytes().data(), datagram.bytes().size())] {
      topics->on_datagram(line);
      topics->on_state(state, sampled, boot);
      devices->on_state(state, sampled);
    });
  });
  board_.on_board_heartbeat([this](const Datagram& datagram) {
    outbox_.push(
        [topics = topics_, line = std::string(datagram.bytes().data(), datagram.bytes().size())] {
          topics->on_datagram(line);
          topics->on_heartbeat();
        });
  });
  board_.on_link([this](const LinkStatus& link) { on_link(link); });
  board_.on_event([this](const CarrierEvent& event) {
    if (event.kind == CarrierEvent::Kind::up) return;
    log(LogLevel::warning, event.problem.text());
  });
  on_paths(board_, [this](const PathStatus& path) {
    log(path.state == PathState::carrying ? LogLevel::info : LogLevel::warning,
        fmt::format("path {}: {}", path.name, to_text(path.state)));
    tell_health();
  });
  board_.on_restart([this] {
    ++boots_;
    log(LogLevel::warning, "the board has restarted");
  });
  board_.on_arming([this](DisarmCause cause) {
    if (cause == DisarmCause::none) {
      log(LogLevel::info, "armed");
    } else {
      log(LogLevel::warning, fmt::format("disarmed: {}", to_text(cause)));
    }
    tell_health();
  });
}

void BoardNode::on_link(const LinkStatus& link) {
  const bool heard = is_heard(link.state);
  if (heard != heard_) {
    heard_ = heard;
    outbox_.push([topics = topics_, heard] { topics->on_active(heard); });
    log(heard ? LogLevel::info : LogLevel::warning,
        heard ? "the board is connected" : explain(board_.name(), link).text());
  }
  if (link.in_control && !in_control_) log(LogLevel::info, "the board accepts commands");
  in_control_ = link.in_control;
  tell_health();
  if (options_.arm && link.in_control && !armed_once_) {
    armed_once_ = true;
    commands_.arm_at_first();
  }
}

void BoardNode::on_mismatch(const EntityId& who, const std::optional<Mismatch>& mismatch) {
  mismatches_.erase(who);
  if (mismatch && mismatch->weight == Mismatch::Weight::note) {
    log(LogLevel::info, mismatch->text);
  } else if (mismatch) {
    mismatches_[who] = *mismatch;
    warn(mismatch->text);
  }
  tell_health();
}

void BoardNode::tick() {
  commands_.on_tick();
  const Clock::time_point now = Clock::now();
  if (now >= next_second_) {
    next_second_ = now + 1s;
    tell_health();
    outbox_.push([topics = topics_, heard = heard_] { topics->on_active(heard); });
  }
}

void BoardNode::tell_health() {
  outbox_.push([topics = topics_, health = health(), now = WallClock::now()] {
    topics->on_health(health, now);
  });
}

Health BoardNode::health() const {
  const LinkStatus& link = board_.link();
  const Statistics statistics = board_.statistics();
  const BoardIdentity& who = board_.identity();
  Health health;
  health.hardware_id = who.board_id;
  const bool fine = link.state == HostLinkState::active && link.in_control;
  const DisarmCause disarmed = board_.disarmed_by();
  if (!is_heard(link.state)) {
    health.level = link.state == HostLinkState::lost ? Health::error : Health::stale;
    health.message = explain(board_.name(), link).reason;
  } else if (!fine) {
    health.level = Health::error;
    health.message = explain(board_.name(), link).reason;
  } else if (disarmed != DisarmCause::none) {
    health.level = Health::warning;
    health.message = fmt::format("not armed: {}", to_text(disarmed));
  } else {
    health.level = Health::ok;
    health.message = "armed";
  }
  // One more failed path may disconnect the board.
  const std::vector<PathStatus> paths = board_.paths();
  for (const PathStatus& path : paths) {
    if (paths.size() < 2 || path.state == PathState::carrying || health.level > Health::warning)
      continue;
    health.level = Health::warning;
    health.message += fmt::format("; path {}: {}", path.name, to_text(path.state));
  }
  const auto lost = std::find_if(mismatches_.begin(), mismatches_.end(), [](const auto& each) {
    return each.second.weight == Mismatch::Weight::lost;
  });
  if (lost != mismatches_.end() && health.level <= Health::warning) {
    health.level = Health::warning;
    health.message += "; " + lost->second.text;
  }
  const auto add = [&health](const char* key, std::string value) {
    health.values.emplace_back(key, std::move(value));
  };
  add("url", board_.name());
  for (const PathStatus& path : paths) {
    if (paths.size() < 2) break;
    health.values.emplace_back(
        "path " + path.name,
        fmt::format("{}, loss {:.3f} %, round trip {:.2f} ms, age {:.0f} ms, copies {}",
                    to_text(path.state), path.loss() * 100, path.round_trip_us / 1e3,
                    path.age_us / 1e3, path.copies));
  }
  add("name", who.name);
  add("firmware", who.firmware);
  add("link", to_text(link.state));
  add("safe reason", to_text(link.reason));
  add("chip fault", link.chip.any() ? fmt::format("{}: {}", chip_name(link.chip.address),
                                                  to_text(link.chip.trouble))
                                    : "none");
  const State& state = board_.state();
  if (state.present.has(StateField::dmhsta)) add("dead-man's handle", to_text(state.handle));
  add("state rate (Hz)", fmt::format("{:.1f}", statistics.state_rate_hz));
  add("state age (ms)", fmt::format("{:.1f}", statistics.state_age_us / 1e3));
  add("round trip (ms)", fmt::format("{:.2f}", statistics.round_trip_us / 1e3));
  add("lost", fmt::format("{}", statistics.packets.lost));
  add("loss (%)", fmt::format("{:.3f}", statistics.loss() * 100));
  add("damaged", fmt::format("{}", statistics.damaged));
  add("board restarts", fmt::format("{}", statistics.packets.restarts));
  add("commands", fmt::format("{}", statistics.commands));
  add("commands refused", fmt::format("{}", statistics.refused));
  add("commands too old", fmt::format("{}", commands_.stale()));
  add("commands dropped", fmt::format("{}", commands_.dropped()));
  add("samples malformed", fmt::format("{}", inbox_.malformed()));
  add("samples dropped", fmt::format("{}", inbox_.dropped()));
  constexpr std::size_t most_mismatches = 8;  // a graph may have any number
  add("mismatches", fmt::format("{}", mismatches_.size()));
  for (std::size_t i = 0; const auto& each : mismatches_) {
    if (++i > most_mismatches) break;
    health.values.emplace_back(fmt::format("mismatch {}", i), each.second.text);
  }
  return health;
}

void BoardNode::log(LogLevel level, const std::string& told) {
  const std::string text = printable(told);  // may contain names of foreign nodes and computers
  // Repeated trouble is logged once a second.
  constexpr std::size_t most_kept = 64;
  const Clock::time_point now = Clock::now();
  if (level == LogLevel::info) {
    say(level, text);
    return;
  }
  const auto [known, fresh] = said_.try_emplace(text, now);
  if (!fresh && now - known->second < 1s) return;
  known->second = now;
  if (said_.size() > most_kept) {
    std::erase_if(said_, [now](const auto& each) { return now - each.second >= 1s; });
  }
  if (said_.size() > most_kept) return;  // too many different messages
  say(level, text);
}

void BoardNode::say(LogLevel level, const std::string& text) {
  logged_(level, name_, text);
  outbox_.push(
      [topics = topics_, level, text, time = WallClock::now()] { topics->log(level, text, time); });
}

}  // namespace r4::tool::ros2
