// SPDX-License-Identifier: GPL-3.0-or-later
// Groups of commands from end to end: r4::Board and r4::AsyncBoard opposite simulated boards, and when the
// registers of the chips change.
#include <gtest/gtest.h>

#include <algorithm>
#include <asio/io_context.hpp>
#include <asio/use_future.hpp>
#include <cstdint>
#include <future>
#include <optional>
#include <string>
#include <vector>

#include "firmware/ports/sim/simulated_board.hpp"
#include "r4link/async_board.hpp"
#include "r4link/board.hpp"
#include "r4link/error.hpp"
#include "tests/bench/allocations.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/board_in_a_thread.hpp"
#include "tests/support/problems.hpp"
#include "transports/memory_carrier.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

constexpr Direction forward = Direction::forward;
using Lines = std::vector<std::string>;

// When, on the bus, each wheel begins to do what it is to do: by the chips' outputs, which change at the end
// of a transfer.
class Wheels final : public sim::I2cObserver {
 public:
  // `osmc`: how many of the four are OSMC channels, the others DHB12.
  Wheels(sim::BoardChips& chips, Drive wanted, int osmc)
      : chips_(chips), wanted_(wanted), osmc_(osmc) {
    chips_.bus.set_observer(this);
  }
  ~Wheels() { chips_.bus.set_observer(nullptr); }
  Wheels(const Wheels&) = delete;
  Wheels& operator=(const Wheels&) = delete;

  bool all() const {
    return std::all_of(std::begin(changed_ns_), std::end(changed_ns_), [](auto& c) { return !!c; });
  }
  double skew_ms() const {
    const auto [first, last] = std::minmax_element(std::begin(changed_ns_), std::end(changed_ns_));
    return static_cast<double>(**last - **first) / 1e6;
  }

 private:
  void on_transfer(const sim::I2cTransfer& transfer) override {
    for (int i = 0; i < 4; ++i) {
      const Drive drive = i < osmc_ ? chips_.osmc_drive(i + 1) : chips_.dhb12_drive(i + 1 - osmc_);
      if (drive == wanted_ && !changed_ns_[i]) {
        changed_ns_[i] = transfer.start_ns + transfer.duration_ns;
      }
    }
  }

  sim::BoardChips& chips_;
  Drive wanted_;
  int osmc_;
  std::optional<std::uint64_t> changed_ns_[4];
};

// The skew of four wheels that are set by one apply().
double skew_of(const std::string& transport, int osmc, Drive before, Drive wanted) {
  BoardInAThread simulated(transport);
  Board board(simulated.url(), at_will());
  board.wait_active();
  const auto all = [&](Drive drive) {
    Setpoints wheels;
    for (int i = 1; i <= osmc; ++i) wheels.osmc(i, drive.pwm, drive.direction);
    for (int i = 1; i <= 4 - osmc; ++i) wheels.dhb12(i, drive.pwm, drive.direction);
    return wheels;
  };
  board.apply(all(before));
  std::optional<Wheels> wheels;
  simulated.run([&](sim::SimulatedBoard& b) { wheels.emplace(b.model().chips(), wanted, osmc); });
  board.apply(all(wanted));
  double skew_ms = -1;
  simulated.run([&](sim::SimulatedBoard&) {
    EXPECT_TRUE(wheels->all());
    if (wheels->all()) skew_ms = wheels->skew_ms();
    wheels.reset();
  });
  return skew_ms;
}

TEST(BoardGroup, FourWheelsOfOneChipChangeAtOnceAndOfTwoWithinAMillisecond) {
  const Drive off;
  const Drive ahead{358, forward};
  const Drive back{4000, Direction::reverse};
  for (const char* transport : {"udp", "pty"}) {
    for (const auto& [before, wanted] : {std::pair(off, ahead), std::pair(ahead, back)}) {
      EXPECT_EQ(skew_of(transport, 4, before, wanted), 0) << transport;
      EXPECT_EQ(skew_of(transport, 0, before, wanted), 0) << transport;
      const double skew_ms = skew_of(transport, 2, before, wanted);
      RecordProperty("skew_us", static_cast<int>(skew_ms * 1000));
      EXPECT_GT(skew_ms, 0) << transport;
      EXPECT_LE(skew_ms, 1) << transport;
    }
  }
}

TEST(BoardGroup, IsConfirmedAsOneAndRefusedAsOne) {
  BoardInAThread simulated("udp");
  Board board(simulated.url(), at_will());
  board.fields("DEFAULT,OSMC2,SERVO3POS,DAC2");
  board.apply(Setpoints{}.osmc(1, 358, forward).osmc(2, 359, forward).servo(3, 1500).dac(2, 1650));
  const State state = board.next_state();
  EXPECT_EQ(state.osmc[0], (Drive{358, forward}));
  EXPECT_EQ(state.osmc[1], (Drive{359, forward}));
  EXPECT_EQ(state.servo_us[2], 1500);
  EXPECT_EQ(state.dac_mv[1], 1650);
  board.send("O:1,1,1;O:2,1,2");
  EXPECT_EQ(board.next_state().osmc[1].pwm, 2);
  board.stop();
  const Problem refused = problem_of([&] { board.send("O:5,1,1;O:6,1,2"); });
  EXPECT_EQ(refused.outcome, Outcome::refused);
  EXPECT_EQ(refused.refusal, Refusal::safe);
  EXPECT_EQ(refused.thing, "O:5,1,1;O:6,1,2");
  EXPECT_TRUE(contains(refused.reason, "none of the 2 commands was executed"));
  EXPECT_EQ(problem_of([&] { board.apply(Setpoints{}); }).kind, ErrorKind::usage);
  EXPECT_EQ(problem_of([&] { board.send("O:5,1,1;E:CLEAR"); }).kind, ErrorKind::usage);
  EXPECT_EQ(problem_of([&] { board.apply(Setpoints{}.servo(1, 1), 0ms); }).kind, ErrorKind::usage);
}

TEST(BoardGroup, IsPostedWithoutAllocatingAnything) {
  Board board("sim:", at_will());
  board.wait_active();
  board.identify();
  int sent = 0;
  const std::uint64_t before = bench::allocations_of_this_thread();
  for (int i = 0; i < 20; ++i) {
    if (board.post(Setpoints{}.osmc(1, 100 + i, forward).osmc(2, 100 + i, forward))) ++sent;
    board.next_state();
  }
  EXPECT_EQ(bench::allocations_of_this_thread() - before, 0U);
  EXPECT_EQ(sent, 20);
}

// A host and a board on one loop.
struct OneLoop {
  OneLoop() : ends(make_memory_pair(io)) {
    sim::SimulatedBoard::Options options;
    options.events.on_executed = [this](std::uint32_t, std::uint32_t pnum, const Command& command) {
      if (drives_output(command.kind)) pnums.push_back(pnum);
    };
    simulated.emplace(io, std::move(options));
    simulated->add_carrier(std::move(ends.second));
    simulated->start();
    host.emplace(io, std::move(ends.first), at_will());
    host->open();
  }
  CommandResult apply(const Setpoints& setpoints) {
    std::optional<CommandResult> result;
    host->async_apply(setpoints, 5s, [&](const CommandResult& r) { result = r; });
    const auto deadline = std::chrono::steady_clock::now() + 10s;
    io.restart();
    while (!result && std::chrono::steady_clock::now() < deadline) io.run_one_for(1s);
    EXPECT_TRUE(result);
    return result.value_or(CommandResult());
  }

  asio::io_context io;
  std::pair<std::unique_ptr<Carrier>, std::unique_ptr<Carrier>> ends;
  std::vector<std::uint32_t> pnums;  // under which the outputs were set
  std::optional<sim::SimulatedBoard> simulated;
  std::optional<AsyncBoard> host;
};

TEST(AsyncBoardGroup, IsOneDatagram) {
  const Setpoints wheels = Setpoints{}.osmc(1, 358, forward).osmc(2, 358, forward).servo(3, 1500);
  OneLoop loop;
  EXPECT_EQ(loop.apply(wheels).outcome, Outcome::confirmed);
  ASSERT_EQ(loop.pnums.size(), 3U);
  EXPECT_EQ(loop.pnums[0], loop.pnums[2]);
  EXPECT_TRUE(loop.host->post(wheels));
}

TEST(AsyncBoardGroup, OfNoneIsThrownBackAndOfAClosedBoardEnds) {
  asio::io_context io;
  AsyncBoard board(io, "sim:", at_will());
  EXPECT_THROW(board.async_apply(Setpoints{}, 1s, [](const CommandResult&) {}), Error);
  EXPECT_THROW(board.post(Setpoints{}), Error);
  std::future<CommandResult> result =
      board.async_apply(Setpoints{}.servo(1, 1), 1s, asio::use_future);
  io.run();
  EXPECT_EQ(result.get().outcome, Outcome::closed);
}

}  // namespace
}  // namespace r4::test
