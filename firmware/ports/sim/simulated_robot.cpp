// SPDX-License-Identifier: GPL-3.0-or-later
#include <asio/post.hpp>
#include <map>
#include <utility>

#include "r4link/error.hpp"
#include "r4link/simulation.hpp"
#include "robot_world.hpp"
#include "script.hpp"

namespace r4::sim {

namespace {

using World = SimulatedRobot::World;

// A URL is text, so worlds of this process are found by number.
struct Worlds {
  std::mutex mutex;
  std::map<long, std::weak_ptr<World>> by_number;
  long last = 0;
};

Worlds& worlds() {
  static Worlds all;
  return all;
}

}  // namespace

std::shared_ptr<World> World::find(long number) {
  const std::lock_guard lock(worlds().mutex);
  const auto found = worlds().by_number.find(number);
  return found == worlds().by_number.end() ? nullptr : found->second.lock();
}

long World::enter(const std::shared_ptr<World>& world) {
  const std::lock_guard lock(worlds().mutex);
  std::erase_if(worlds().by_number, [](const auto& each) { return each.second.expired(); });
  worlds().by_number[++worlds().last] = world;
  return worlds().last;
}

void World::happen(ScriptStep step) {
  const std::lock_guard lock(mutex_);
  said_.push_back(std::move(step));
  if (io_ == nullptr) return;
  asio::post(*io_, [world = weak_from_this(), io = io_] {
    if (const auto still_there = world.lock()) still_there->settle(*io);
  });
}

SimulatedRobot::Look World::look() const {
  const std::lock_guard lock(mutex_);
  return look_;
}

void World::attach(asio::io_context& io, SimulatedBoard& board) {
  const std::lock_guard lock(mutex_);
  if (board_ != nullptr) {
    throw Error(ErrorKind::open, "sim:", "another link of this program has that simulated robot",
                "close it first, or make a SimulatedRobot for each");
  }
  io_ = &io;
  board_ = &board;
  board.model().connect(robot_);
  look_.open = true;
}

void World::detach() noexcept {
  const std::lock_guard lock(mutex_);
  io_ = nullptr;
  board_ = nullptr;
  look_.open = false;
}

void World::note() {
  const std::lock_guard lock(mutex_);
  if (board_ == nullptr) return;
  const BoardModel& model = board_->model();
  look_.pins = model.pins();
  look_.motors_have_supply = model.motors_have_supply();
  look_.handle_held = model.handle_held();
  for (int i = 0; i < encoder_channels; ++i) look_.encoder[i] = model.shaft_count(i + 1);
  for (int i = 0; i < stepper_channels; ++i) look_.stepper[i] = model.stepper_shaft(i + 1);
  for (int i = 0; i < analog_channels; ++i) {
    look_.analog_cv[i] = model.analog_cv(static_cast<Analog>(i));
  }
}

void World::settle(const asio::io_context& io) {
  std::vector<ScriptStep> now;
  SimulatedBoard* board = nullptr;
  {
    const std::lock_guard lock(mutex_);
    if (io_ != &io) return;  // closed meanwhile: steps wait for the next open
    now.swap(said_);
    board = board_;
  }
  for (const ScriptStep& step : now) board->happen(step);
  note();
}

SimulatedRobot::SimulatedRobot() : SimulatedRobot(nullptr) {}
SimulatedRobot::SimulatedRobot(RobotModel& robot) : SimulatedRobot(&robot) {}

SimulatedRobot::SimulatedRobot(RobotModel* robot) : world_(std::make_shared<World>(robot)) {
  url_ = "sim:?robot=" + std::to_string(World::enter(world_));
}

SimulatedRobot::~SimulatedRobot() = default;

const std::string& SimulatedRobot::url() const { return url_; }

void SimulatedRobot::happen(std::string_view words) {
  if (auto step = Script::parse_now(words, url_)) world_->happen(std::move(*step));
}

SimulatedRobot::Look SimulatedRobot::look() const { return world_->look(); }

}  // namespace r4::sim
