// SPDX-License-Identifier: GPL-3.0-or-later
// r4::Board and r4::AsyncBoard over several paths, in real time: a board on UDP and a pty, and on
// memory carriers that the test unplugs.
#include <gtest/gtest.h>

#include <asio/io_context.hpp>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "firmware/ports/sim/simulated_board.hpp"
#include "r4link/async_board.hpp"
#include "r4link/board.hpp"
#include "tests/bench/allocations.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/board_in_a_thread.hpp"
#include "tests/support/carriers.hpp"
#include "tests/support/on_a_loop.hpp"
#include "tests/support/problems.hpp"
#include "transports/memory_carrier.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

TEST(BoardPaths, LeadToOneBoardOverUdpAndAPty) {
  BoardInAThread simulated(std::vector<std::string>{"udp", "pty"});
  Board board(simulated.urls(), at_will());
  board.wait_active();
  for (int i = 0; i < 500 && board.link().carrying != 3; ++i) board.next_state();
  EXPECT_EQ(board.link().carrying, 3);
  const std::vector<PathStatus> paths = board.paths();
  ASSERT_EQ(paths.size(), 2U);
  EXPECT_EQ(paths[0].board_id, "test-board");
  EXPECT_TRUE(contains(paths[0].name, "udp://127.0.0.1:"));
  EXPECT_TRUE(contains(paths[1].name, "serial:///dev/pts/"));
  EXPECT_EQ(paths[1].state, PathState::carrying);
  EXPECT_GT(paths[1].round_trip_us, 0);
  EXPECT_TRUE(contains(board.name(), paths[0].name + " " + paths[1].name));
  for (int i = 0; i < 30; ++i) board.next_state();
  EXPECT_GT(board.statistics().copies, 10U);
}

TEST(BoardPaths, AreRefusedIfTheyCannotLeadToOneBoard) {
  asio::io_context io;
  const auto refusal = [&](const std::vector<std::string>& urls) {
    const Problem problem = problem_of([&] { AsyncBoard board(io, urls); });
    EXPECT_EQ(problem.kind, ErrorKind::usage);
    return problem.text();
  };
  EXPECT_TRUE(contains(refusal({"udp://r4.local", "udp://R4.local:2018"}), "twice"));
  EXPECT_TRUE(contains(refusal({"can://can0", "serial:auto", "can://can0?node=1&fd=1"}), "twice"));
  EXPECT_TRUE(
      contains(refusal({"serial:///dev/../dev/ttyACM0", "serial:///dev/ttyACM0"}), "twice"));
  EXPECT_TRUE(contains(refusal({"sim:", "udp://r4.local"}), "a separate board"));
  EXPECT_TRUE(contains(refusal({"serial:auto", "sim:"}), "a separate board"));
  EXPECT_TRUE(contains(refusal({"udp://r4.local", "tcp://r4.local"}), "no transport"));
  EXPECT_TRUE(contains(refusal({}), "0 paths"));
  EXPECT_TRUE(
      contains(refusal({"udp://a", "udp://b", "udp://c", "udp://d", "udp://e"}), "5 paths"));
  AsyncBoard(io, {"can://can0", "can://can1", "can://can1?node=2", "udp://10.0.0.1"});
}

// The first three openings fail, each in a different way.
class OpensAtLast final : public IdleCarrier {
 public:
  explicit OpensAtLast(int& openings) : openings_(openings) {}
  void open(Handler& handler) override {
    ++openings_;
    if (openings_ == 1) throw Error(ErrorKind::open, "path 2", "it is missing", "plug it in");
    if (openings_ == 2) throw Error(ErrorKind::usage, "path 2", "two devices match", "unplug one");
    if (openings_ == 3) throw std::runtime_error("not an Error");
    IdleCarrier::open(handler);
  }

 private:
  int& openings_;
};

TEST(AsyncBoardPaths, ReopenAPathAfterAnyExceptionOfItsTransport) {
  OnALoop loop;
  int openings = 0;
  std::vector<std::unique_ptr<Carrier>> carriers;
  carriers.push_back(std::make_unique<IdleCarrier>());
  carriers.push_back(std::make_unique<OpensAtLast>(openings));
  AsyncBoard board(loop.io, std::move(carriers), at_will());
  std::vector<ErrorKind> downs;
  board.on_event([&](const CarrierEvent& event) {
    if (event.kind == CarrierEvent::Kind::down) downs.push_back(event.problem.kind);
  });
  board.open();
  EXPECT_EQ(board.paths()[1].state, PathState::down);
  EXPECT_THROW(static_cast<void>(loop.run_until([] { return false; })), std::runtime_error);
  EXPECT_TRUE(loop.run_until([&] { return openings == 4; }));
  EXPECT_EQ(downs, (std::vector<ErrorKind>{ErrorKind::open, ErrorKind::usage}));
}

// One end of a memory carrier, which the test can unplug.
class Pluggable final : public WrappedCarrier {
 public:
  using WrappedCarrier::WrappedCarrier;
  SendResult send(std::string_view bytes, Priority priority, Peer to) override {
    return plugged_ ? WrappedCarrier::send(bytes, priority, to) : SendResult::down;
  }
  bool up() const override { return plugged_ && WrappedCarrier::up(); }
  void plug(bool in) {
    plugged_ = in;
    on_carrier_event({in ? CarrierEvent::Kind::up : CarrierEvent::Kind::down, {}});
  }

 private:
  void on_datagram(std::string_view bytes, Peer from) override {
    if (plugged_) WrappedCarrier::on_datagram(bytes, from);
  }
  bool plugged_ = true;
};

struct BoardPathsInMemory : testing::Test, OnALoop {
  void SetUp() override {
    sim::SimulatedBoard::Options options;
    options.board_id = "in-memory";
    simulated = std::make_unique<sim::SimulatedBoard>(io, std::move(options));
    std::vector<std::unique_ptr<Carrier>> ends;
    for (Pluggable*& path : paths) {
      auto [host_end, board_end] = make_memory_pair(io);
      auto pluggable = std::make_unique<Pluggable>(std::move(host_end));
      path = pluggable.get();
      ends.push_back(std::move(pluggable));
      simulated->add_carrier(std::move(board_end));
    }
    simulated->start();
    board = std::make_unique<AsyncBoard>(io, std::move(ends), at_will());
    board->open();
    ASSERT_TRUE(run_until([&] { return board->in_control() && board->link().carrying == 3; }));
  }

  Pluggable* paths[2] = {};
  std::unique_ptr<sim::SimulatedBoard> simulated;
  std::unique_ptr<AsyncBoard> board;
};

TEST_F(BoardPathsInMemory, ReportWhenAPathBeginsOrStopsCarrying) {
  std::vector<PathStatus> told;
  const Subscription keep = board->on_path([&](const PathStatus& path) { told.push_back(path); });
  paths[0]->plug(false);
  ASSERT_EQ(told.size(), 1U) << "the event must be reported at once";
  EXPECT_EQ(told[0].state, PathState::down);
  EXPECT_EQ(board->link().state, HostLinkState::active);
  paths[0]->plug(true);
  ASSERT_TRUE(run_until([&] { return told.size() == 2; }));
  EXPECT_EQ(told[1].state, PathState::carrying);
  EXPECT_TRUE(board->in_control());
}

TEST_F(BoardPathsInMemory, AllocateNothingPerDatagram) {
  io.run_for(300ms);
  const std::uint64_t before = bench::allocations();
  const std::uint64_t states = board->statistics().states;
  io.run_for(500ms);
  EXPECT_GT(board->statistics().states, states + 20);
  EXPECT_LE(bench::allocations() - before, 10U) << "a datagram must not allocate";
}

}  // namespace
}  // namespace r4::test
