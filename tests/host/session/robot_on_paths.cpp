// SPDX-License-Identifier: GPL-3.0-or-later
#include "robot_on_paths.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

namespace r4::test {

struct RobotOnPaths::Board final : firmware::Hal, firmware::Observer {
  struct End final : firmware::Port {
    End(RobotOnPaths& r, std::size_t b, std::size_t w) : robot(r), board(b), path(w) {}
    void send(Text bytes, Priority, Peer) override {
      if (robot.cables[path].board == board) robot.put(path, false, {bytes.data(), bytes.size()});
    }
    std::size_t max_size() const override { return max_datagram; }
    bool reaches(Peer) const override { return true; }
    bool may_configure() const override { return true; }

    RobotOnPaths& robot;
    const std::size_t board;
    const std::size_t path;
    std::uint8_t number = 0;
  };

  // A cable may be plugged into another board, so each board has a port for each cable.
  Board(RobotOnPaths& r, std::size_t i) : robot(r), name("board-" + std::to_string(i)) {
    for (std::size_t path = 0; path < robot.cables.size(); ++path) {
      ends.push_back(std::make_unique<End>(robot, i, path));
    }
  }
  void boot(std::uint32_t t_ms) {
    firmware::Application::Config config;
    config.identity = Identity{Text("0.1.0"), Text(name.data(), name.size()), Text("sim")};
    config.settings = robot.settings_;
    static const std::uint8_t chance[Authentication::chance_size] = {7};
    config.chance = chance;
    offset_ms = t_ms - static_cast<std::uint32_t>(robot.now_ms_);
    was_active = false;
    application = std::make_unique<firmware::Application>(*this, config, this);
    for (const auto& end : ends) end->number = application->add_port(*end);
    application->start(now());
  }
  std::uint32_t now() const { return static_cast<std::uint32_t>(robot.now_ms_) + offset_ms; }

  void apply(const firmware::Outputs&) override {}
  void make_safe() override {}
  void sample(firmware::Inputs& inputs) override { inputs.handle = Handle::held; }
  void zero(int) override {}
  bool clear_fault() override { return true; }
  void on_state(std::uint32_t, firmware::BoardState state, SafeReason) override {
    const bool active = state == firmware::BoardState::active;
    robot.trips += was_active && !active ? 1 : 0;
    was_active = active;
  }
  void on_outputs(std::uint32_t, const firmware::Outputs&) override {}
  void on_executed(std::uint32_t, std::uint32_t pnum, const Command&) override { ++executed[pnum]; }
  void on_refused(std::uint32_t, std::uint32_t, Refusal) override {}
  void on_rejected(std::uint32_t, Verdict) override {}

  RobotOnPaths& robot;
  const std::string name;
  std::vector<std::unique_ptr<End>> ends;
  std::unique_ptr<firmware::Application> application;
  std::uint32_t offset_ms = 0;
  bool was_active = false;
  std::map<std::uint32_t, int> executed;
};

std::vector<std::string> RobotOnPaths::Cable::all(char letter) const {
  std::vector<std::string> found;
  std::copy_if(sent.begin(), sent.end(), std::back_inserter(found),
               [letter](const std::string& each) { return each.front() == letter; });
  return found;
}

SessionOptions RobotOnPaths::at_will() {
  SessionOptions options;
  options.arming = Arming::off;
  return options;
}

RobotOnPaths::RobotOnPaths(Cables its_cables, SessionOptions options, BoardRole role,
                           Settings settings)
    : cables(std::move(its_cables)), settings_(std::move(settings)), up_(cables.size()) {
  std::size_t last = 0;
  for (const Cable& cable : cables) last = std::max(last, cable.board);
  for (std::size_t i = 0; i <= last; ++i) {
    boards_.push_back(std::make_unique<Board>(*this, i));
    boards_[i]->boot(100'000 * static_cast<std::uint32_t>(i + 1));
  }
  DrivenSession::Handler& handler = *this;
  session = std::make_unique<DrivenSession>(handler, std::move(options), role, cables.size(),
                                            [n = 99ULL]() mutable { return ++n; });
}
RobotOnPaths::~RobotOnPaths() = default;

firmware::Application& RobotOnPaths::board(std::size_t index) {
  return *boards_[index]->application;
}
const std::map<std::uint32_t, int>& RobotOnPaths::executed(std::size_t board) const {
  return boards_[board]->executed;
}

void RobotOnPaths::connect() {
  for (std::size_t path = 0; path < cables.size(); ++path) plug(path, true);
  run(500);
}

void RobotOnPaths::cut(std::size_t path, bool is_cut) {
  cables[path].cut_to_board = cables[path].cut_to_host = is_cut;
}

void RobotOnPaths::plug(std::size_t path, bool in) {
  up_[path] = in;
  if (!in) std::erase_if(packets_, [path](const Packet& each) { return each.path == path; });
  session->on_transport(path, in, now(), !cables[path].listens);
  session->poll(now());
  Board& at = *boards_[cables[path].board];
  for (const auto& end : at.ends) {
    if (end->path == path && !in) at.application->port_down(end->number, at.now());
  }
}

void RobotOnPaths::reboot(std::size_t board) { boards_[board]->boot(50); }

void RobotOnPaths::bring(std::size_t path, std::string_view bytes) {
  session->receive(path, bytes, now());
  session->poll(now());
}

std::uint32_t RobotOnPaths::board_ms(std::size_t board) const { return boards_[board]->now(); }

CommandResult RobotOnPaths::finish(Ticket ticket, std::uint32_t most_ms) {
  for (; most_ms != 0 && results.find(ticket) == results.end(); --most_ms) run(1);
  const auto found = results.find(ticket);
  return found == results.end() ? CommandResult{Outcome::none} : found->second;
}

void RobotOnPaths::run(std::uint32_t ms) {
  for (; ms != 0; --ms) pass(Host::runs);
}

void RobotOnPaths::stall(std::uint32_t ms) {
  for (; ms != 0; --ms) pass(Host::stalls);
}

void RobotOnPaths::sleep(std::uint32_t ms) {
  pause(ms);
  session->on_sleep(now());
}

void RobotOnPaths::pause(std::uint32_t ms) {
  for (; ms != 0; --ms) pass(Host::sleeps);
}

void RobotOnPaths::pass(Host host) {
  ++now_ms_;
  if (host == Host::sleeps) ++slept_ms_;
  for (std::size_t n = packets_.size(); n != 0; --n) {
    Packet packet = std::move(packets_.front());
    packets_.pop_front();
    if (packet.at_ms > now_ms_ || (host == Host::stalls && !packet.to_board)) {
      packets_.push_back(std::move(packet));
    } else if (packet.to_board) {
      Board& at = *boards_[cables[packet.path].board];
      for (const auto& end : at.ends) {
        if (end->path != packet.path) continue;
        at.application->receive(end->number, 1, Text(packet.bytes.data(), packet.bytes.size()),
                                at.now());
      }
    } else if (host == Host::runs) {
      session->receive(packet.path, packet.bytes, now());
    }
  }
  for (const auto& each : boards_) each->application->poll(each->now());
  if (host == Host::runs) session->poll(now());
}

void RobotOnPaths::put(std::size_t path, bool to_board, std::string_view bytes) {
  const Cable& cable = cables[path];
  if (!up_[path] || (to_board ? cable.cut_to_board : cable.cut_to_host)) return;
  if (to_board && !cable.loses.empty() && bytes.starts_with(cable.loses)) return;
  packets_.push_back({now_ms_ + cable.lag_ms, path, to_board, std::string(bytes)});
}

SendResult RobotOnPaths::transmit(std::size_t path, std::string_view bytes, Priority priority) {
  if (!up_[path]) return SendResult::down;
  if (cables[path].listens && priority != Priority::lease) return SendResult::down;
  if (keeps_states) cables[path].sent.emplace_back(bytes);
  put(path, true, bytes);
  return SendResult::sent;
}

void RobotOnPaths::on_state(const ReceivedState& state, const Datagram&) {
  if (keeps_states) states.push_back(state);
  went_back = went_back || (told_states != 0 && newer(last_t_ms_, state.t_ms));
  if (told_states != 0) longest_gap_ms = std::max(longest_gap_ms, now_ms_ - last_state_ms_);
  ++told_states;
  last_state_ms_ = now_ms_;
  last_t_ms_ = state.t_ms;
  oldest_age_ms = std::max(oldest_age_ms, board_ms(0) - state.t_ms);
}

}  // namespace r4::test
