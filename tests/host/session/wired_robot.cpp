// SPDX-License-Identifier: GPL-3.0-or-later
#include "wired_robot.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

namespace r4::test {

struct WiredRobot::Board final : firmware::Hal, firmware::Observer {
  struct End final : firmware::Port {
    End(WiredRobot& r, std::size_t b, std::size_t w) : robot(r), board(b), wire(w) {}
    void send(Text bytes, Priority, Peer) override {
      if (robot.cables[wire].board == board) robot.put(wire, false, {bytes.data(), bytes.size()});
    }
    std::size_t max_size() const override { return max_datagram; }
    bool reaches(Peer) const override { return true; }
    bool may_configure() const override { return true; }

    WiredRobot& robot;
    const std::size_t board;
    const std::size_t wire;
    std::uint8_t number = 0;
  };

  // A cable may be plugged into another board: each has a port for each.
  Board(WiredRobot& r, std::size_t i) : robot(r), name("board-" + std::to_string(i)) {
    for (std::size_t wire = 0; wire < robot.cables.size(); ++wire) {
      ends.push_back(std::make_unique<End>(robot, i, wire));
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
  void sample(firmware::Inputs& inputs) override { inputs.handle_held = true; }
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

  WiredRobot& robot;
  const std::string name;
  std::vector<std::unique_ptr<End>> ends;
  std::unique_ptr<firmware::Application> application;
  std::uint32_t offset_ms = 0;
  bool was_active = false;
  std::map<std::uint32_t, int> executed;
};

std::vector<std::string> WiredRobot::Cable::all(char letter) const {
  std::vector<std::string> found;
  std::copy_if(sent.begin(), sent.end(), std::back_inserter(found),
               [letter](const std::string& each) { return each.front() == letter; });
  return found;
}

SessionOptions WiredRobot::at_will() {
  SessionOptions options;
  options.arming = Arming::off;
  return options;
}

WiredRobot::WiredRobot(Cables its_cables, SessionOptions options, BoardRole role, Settings settings)
    : cables(std::move(its_cables)), settings_(std::move(settings)), up_(cables.size()) {
  std::size_t last = 0;
  for (const Cable& cable : cables) last = std::max(last, cable.board);
  for (std::size_t i = 0; i <= last; ++i) {
    boards_.push_back(std::make_unique<Board>(*this, i));
    boards_[i]->boot(100'000 * static_cast<std::uint32_t>(i + 1));
  }
  Session::Handler& handler = *this;
  session = std::make_unique<Session>(handler, std::move(options), role, cables.size(),
                                      [n = 99ULL]() mutable { return ++n; });
}
WiredRobot::~WiredRobot() = default;

firmware::Application& WiredRobot::board(std::size_t index) { return *boards_[index]->application; }
const std::map<std::uint32_t, int>& WiredRobot::executed(std::size_t board) const {
  return boards_[board]->executed;
}

void WiredRobot::connect() {
  for (std::size_t wire = 0; wire < cables.size(); ++wire) plug(wire, true);
  run(500);
}

void WiredRobot::cut(std::size_t wire, bool is_cut) {
  cables[wire].cut_to_board = cables[wire].cut_to_host = is_cut;
}

void WiredRobot::plug(std::size_t wire, bool in) {
  up_[wire] = in;
  if (!in) std::erase_if(packets_, [wire](const Packet& each) { return each.wire == wire; });
  session->on_transport(wire, in, now(), !cables[wire].listens);
  session->poll(now());
  Board& at = *boards_[cables[wire].board];
  for (const auto& end : at.ends) {
    if (end->wire == wire && !in) at.application->port_down(end->number, at.now());
  }
}

void WiredRobot::reboot(std::size_t board, std::uint32_t t_ms) { boards_[board]->boot(t_ms); }

void WiredRobot::bring(std::size_t wire, std::string_view bytes) {
  session->receive(wire, bytes, now());
  session->poll(now());
}

std::uint32_t WiredRobot::board_ms(std::size_t board) const { return boards_[board]->now(); }

CommandResult WiredRobot::finish(Ticket ticket, std::uint32_t most_ms) {
  for (; most_ms != 0 && results.find(ticket) == results.end(); --most_ms) run(1);
  const auto found = results.find(ticket);
  return found == results.end() ? CommandResult{Outcome::none} : found->second;
}

void WiredRobot::run(std::uint32_t ms) {
  for (; ms != 0; --ms) pass(false);
}

void WiredRobot::sleep(std::uint32_t ms) {
  pause(ms);
  session->on_sleep(now());
}

void WiredRobot::pause(std::uint32_t ms) {
  for (; ms != 0; --ms) pass(true);
}

void WiredRobot::pass(bool asleep) {
  ++now_ms_;
  if (asleep) ++slept_ms_;
  for (std::size_t n = packets_.size(); n != 0; --n) {
    Packet packet = std::move(packets_.front());
    packets_.pop_front();
    if (packet.at_ms > now_ms_) {
      packets_.push_back(std::move(packet));
    } else if (packet.to_board) {
      Board& at = *boards_[cables[packet.wire].board];
      for (const auto& end : at.ends) {
        if (end->wire != packet.wire) continue;
        at.application->receive(end->number, 1, Text(packet.bytes.data(), packet.bytes.size()),
                                at.now());
      }
    } else if (!asleep) {
      session->receive(packet.wire, packet.bytes, now());
    }
  }
  for (const auto& each : boards_) each->application->poll(each->now());
  if (!asleep) session->poll(now());
}

void WiredRobot::put(std::size_t wire, bool to_board, std::string_view bytes) {
  const Cable& cable = cables[wire];
  if (!up_[wire] || (to_board ? cable.cut_to_board : cable.cut_to_host)) return;
  packets_.push_back({now_ms_ + cable.lag_ms, wire, to_board, std::string(bytes)});
}

SendResult WiredRobot::transmit(std::size_t wire, std::string_view bytes, Priority priority) {
  if (!up_[wire]) return SendResult::down;
  if (cables[wire].listens && priority != Priority::lease) return SendResult::down;
  if (keeps_states) cables[wire].sent.emplace_back(bytes);
  put(wire, true, bytes);
  return SendResult::sent;
}

void WiredRobot::on_state(const ReceivedState& state, const Datagram&) {
  if (keeps_states) states.push_back(state);
  went_back = went_back || (told_states != 0 && newer(last_t_ms_, state.t_ms));
  if (told_states != 0) longest_gap_ms = std::max(longest_gap_ms, now_ms_ - last_state_ms_);
  ++told_states;
  last_state_ms_ = now_ms_;
  last_t_ms_ = state.t_ms;
  oldest_age_ms = std::max(oldest_age_ms, board_ms(0) - state.t_ms);
}

}  // namespace r4::test
