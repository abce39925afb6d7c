// SPDX-License-Identifier: GPL-3.0-or-later
#include "sim_carrier.hpp"

#include <limits>
#include <utility>

#include "../../../transports/memory_carrier.hpp"
#include "robot_world.hpp"
#include "simulated_board.hpp"

namespace r4::sim {

namespace {

class SimCarrier final : public Carrier {
 public:
  SimCarrier(asio::io_context& io, std::unique_ptr<SimulatedBoard> board,
             std::unique_ptr<Carrier> end, std::shared_ptr<SimulatedRobot::World> world)
      : io_(io), board_(std::move(board)), end_(std::move(end)), world_(std::move(world)) {}
  ~SimCarrier() override { leave(); }

  void open(Handler& handler) override {
    if (world_ != nullptr && !attached_) world_->attach(io_, *board_);
    attached_ = world_ != nullptr;
    board_->start();  // first, so that the end is up at once
    if (attached_) world_->settle(io_);
    end_->open(handler);
  }
  void close() noexcept override {
    leave();
    end_->close();
    board_->stop();
  }
  SendResult send(std::string_view bytes, Priority priority, Peer to) override {
    return end_->send(bytes, priority, to);
  }
  bool up() const override { return end_->up(); }
  const std::string& name() const override { return end_->name(); }
  const CarrierCounters& counters() const override { return end_->counters(); }

 private:
  void leave() noexcept {
    if (attached_) world_->detach();
    attached_ = false;
  }

  asio::io_context& io_;
  std::unique_ptr<SimulatedBoard> board_;
  std::unique_ptr<Carrier> end_;
  std::shared_ptr<SimulatedRobot::World> world_;
  bool attached_ = false;
};

std::shared_ptr<SimulatedRobot::World> world_of(const Url& url) {
  if (!url.get("robot")) return nullptr;
  auto world =
      SimulatedRobot::World::find(url.get_number("robot", 1, std::numeric_limits<long>::max(), 0));
  if (world == nullptr) {
    throw Error(ErrorKind::usage, url.text(), "this program has no such SimulatedRobot",
                "take the url() of one, and keep it as long as the board is open");
  }
  return world;
}

}  // namespace

std::unique_ptr<Carrier> make_sim_carrier(asio::io_context& io, const Url& url) {
  url.allow_only("node seed script robot");
  if (!url.host().empty() || !url.path().empty()) {
    throw Error(ErrorKind::usage, url.text(), "a simulated board has no place",
                "write sim: or, for another board, sim:?node=2");
  }
  SimulatedBoard::Options options;
  options.board_id = "sim-" + std::to_string(url.get_number("node", 0, 31, 1));
  if (url.get("seed")) {
    constexpr long max = std::numeric_limits<long>::max();
    options.seed = static_cast<std::uint64_t>(url.get_number("seed", 0, max, 0));
  }
  if (const auto script = url.get("script")) options.script = Script::load(*script);
  auto world = world_of(url);
  if (world != nullptr) {
    options.events.on_millisecond = [world] { world->note(); };
  }
  auto [host_end, board_end] = make_memory_pair(io, url.text());
  auto board = std::make_unique<SimulatedBoard>(io, std::move(options));
  board->add_carrier(std::move(board_end));
  return std::make_unique<SimCarrier>(io, std::move(board), std::move(host_end), std::move(world));
}

}  // namespace r4::sim
