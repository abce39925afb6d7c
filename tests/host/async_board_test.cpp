// SPDX-License-Identifier: GPL-3.0-or-later
// r4::AsyncBoard on one event loop with the simulated board.
#include "r4link/async_board.hpp"

#include <gtest/gtest.h>

#include <asio/bind_executor.hpp>
#include <asio/co_spawn.hpp>
#include <asio/detached.hpp>
#include <asio/executor_work_guard.hpp>
#include <asio/steady_timer.hpp>
#include <asio/strand.hpp>
#include <asio/thread_pool.hpp>
#include <asio/use_awaitable.hpp>
#include <asio/use_future.hpp>
#include <optional>
#include <thread>

#include "firmware/ports/sim/simulated_board.hpp"
#include "host/session/session.hpp"
#include "host/standard_registry.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/board_in_a_thread.hpp"
#include "tests/support/datagrams.hpp"
#include "transports/memory_carrier.hpp"
#include "transports/registry.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

const Command start_motor = Command::osmc(358, Direction::forward, 1);

// Runs the loop until `done()`; false after 5 s.
template <class Done>
bool run_until(asio::io_context& io, Done done) {
  const auto deadline = std::chrono::steady_clock::now() + 5s;
  io.restart();
  while (!done()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    if (io.run_one_for(5s) == 0 && io.stopped()) return done();
  }
  return true;
}

struct AsyncBoardTest : testing::Test {
  asio::io_context io;
  AsyncBoard board{io, "sim:?seed=1", at_will()};
};

TEST_F(AsyncBoardTest, SendsItsFirstHeartbeatWhenItOpens) {
  auto [host_end, board_end] = make_memory_pair(io);
  struct Listener final : Carrier::Handler {
    void on_datagram(std::string_view bytes, Peer) override { heard.emplace_back(bytes); }
    void on_carrier_event(const CarrierEvent&) override {}
    std::vector<std::string> heard;
  } listener;
  board_end->open(listener);
  BoardOptions options = at_will();
  options.session.timing.heartbeat_ms = 60'000;  // the second one is far away
  AsyncBoard over_memory(io, std::move(host_end), options);
  over_memory.open();
  ASSERT_TRUE(run_until(io, [&] { return !listener.heard.empty(); }));
  EXPECT_EQ(listener.heard[0].substr(0, 9), "H:ROS2-R4");
  board_end->close();
}

// A path on which another host is heard.
class Overhearing final : public Carrier {
 public:
  void open(Handler& handler) override { handler_ = &handler; }
  void close() noexcept override { handler_ = nullptr; }
  SendResult send(std::string_view, Priority, Peer) override { return SendResult::sent; }
  bool up() const override { return handler_ != nullptr; }
  const std::string& name() const override { return name_; }
  const CarrierCounters& counters() const override { return counters_; }
  void overhear(std::string_view bytes) { handler_->on_overheard(bytes); }

 private:
  Handler* handler_ = nullptr;
  const std::string name_ = "memory:";
  CarrierCounters counters_;
};

TEST_F(AsyncBoardTest, TellsNoSecretOfAnotherHost) {
  auto path = std::make_unique<Overhearing>();
  Overhearing& other = *path;
  AsyncBoard watching(io, std::move(path), at_will());
  std::vector<std::string> heard;
  const auto subscription =
      watching.on_overheard([&](std::string_view bytes) { heard.emplace_back(bytes); });
  watching.open();
  other.overhear(with_crc("C:key,1:5a5a;PNum:1;T:2;"));
  other.overhear(with_crc("O:358,1,1;PNum:2;T:3;"));
  EXPECT_EQ(heard, (std::vector<std::string>{with_crc("C:key,1:...;PNum:1;T:2;"),
                                             with_crc("O:358,1,1;PNum:2;T:3;")}));
}

// Hands over what another carrier receives, and never tells that it is drained.
class Undrained final : public Carrier, private Carrier::Handler {
 public:
  explicit Undrained(std::unique_ptr<Carrier> below) : below_(std::move(below)) {}
  void open(Carrier::Handler& handler) override {
    handler_ = &handler;
    below_->open(*this);
  }
  void close() noexcept override { below_->close(); }
  SendResult send(std::string_view bytes, Priority priority, Peer to) override {
    return below_->send(bytes, priority, to);
  }
  bool up() const override { return below_->up(); }
  const std::string& name() const override { return below_->name(); }
  const CarrierCounters& counters() const override { return below_->counters(); }

 private:
  void on_datagram(std::string_view bytes, Peer from) override {
    handler_->on_datagram(bytes, from);
  }
  void on_carrier_event(const CarrierEvent& event) override { handler_->on_carrier_event(event); }

  std::unique_ptr<Carrier> below_;
  Carrier::Handler* handler_ = nullptr;
};

// As a CAN bus: all hosts send from one place.
class Bus final : public Carrier {
 public:
  explicit Bus(std::vector<std::string>& sent) : sent_(sent) {}
  void open(Handler&) override {}
  void close() noexcept override {}
  SendResult send(std::string_view bytes, Priority, Peer) override {
    sent_.emplace_back(bytes);
    return SendResult::sent;
  }
  bool is_shared() const override { return true; }
  bool up() const override { return true; }
  const std::string& name() const override { return name_; }
  const CarrierCounters& counters() const override { return counters_; }

 private:
  std::vector<std::string>& sent_;
  const std::string name_ = "bus";
  CarrierCounters counters_;
};

TEST_F(AsyncBoardTest, WhoOnlyWatchesSendsNothingButLeasesAndStopsWhereAllHostsHaveOnePlace) {
  std::vector<std::string> sent;
  BoardOptions options;
  options.role = BoardRole::watch;
  AsyncBoard watching(io, std::make_unique<Bus>(sent), options);
  watching.open();
  bool asked = false;
  watching.async_identify(600ms, [&](const CommandResult&) { asked = true; });
  ASSERT_TRUE(run_until(io, [&] { return asked; }));
  for (const std::string& each : sent) EXPECT_EQ(each.substr(0, 2), "W:") << each;
  EXPECT_FALSE(watching.link().causes.has(LinkCause::busy)) << "nobody controls it";
  sent.clear();
  watching.async_stop(50ms, [](const CommandResult&) {});
  ASSERT_TRUE(run_until(io, [&] { return !sent.empty(); }));
  EXPECT_EQ(sent[0].substr(0, 7), "E:STOP;");
}

TEST_F(AsyncBoardTest, TellsStatesOfATransportThatIsNeverDrained) {
  AsyncBoard over(io,
                  std::make_unique<Undrained>(standard_registry().make(io, "sim:", Role::host)));
  int states = 0;
  over.on_state([&](const State&, const Datagram&) { ++states; });
  over.open();
  EXPECT_TRUE(run_until(io, [&] { return states >= 3; }));
}

TEST_F(AsyncBoardTest, TellsOfAHoldUpOnceHoweverMuchFollowsIt) {
  int warnings = 0;
  board.on_event([&](const CarrierEvent& event) {
    if (event.kind == CarrierEvent::Kind::warning) ++warnings;
  });
  board.open();
  ASSERT_TRUE(run_until(io, [&] { return board.in_control(); }));
  bool posted = false;
  asio::post(io, [&] {
    const auto end = std::chrono::steady_clock::now() + 350ms;
    while (std::chrono::steady_clock::now() < end) std::this_thread::yield();
    for (int us = 1000; us < 1100; ++us) board.post(Command::servo(us, 1));
    posted = true;
  });
  ASSERT_TRUE(run_until(io, [&] { return posted && board.state().servo_us[0] == 1099; }));
  EXPECT_EQ(warnings, 1);
}

TEST_F(AsyncBoardTest, TellsEverySubscriberLastWhatIsSo) {
  std::vector<DisarmCause> told;
  AsyncBoard armed(io, "sim:");
  armed.on_arming([&](DisarmCause cause) {
    if (cause == DisarmCause::none) armed.async_stop(1s, [](const CommandResult&) {});
  });
  armed.on_arming([&](DisarmCause cause) { told.push_back(cause); });
  armed.open();
  armed.async_arm(3s, [](const CommandResult&) {});
  ASSERT_TRUE(run_until(io, [&] { return armed.link().reason == SafeReason::stop; }));
  ASSERT_FALSE(told.empty());
  EXPECT_EQ(told.back(), DisarmCause::stop) << "the first one stopped the board meanwhile";
}

TEST_F(AsyncBoardTest, ConfirmsThroughAFuture) {
  board.open();
  std::thread loop([&] {
    const auto work = asio::make_work_guard(io);
    io.run();
  });
  auto sent =
      asio::post(
          io, asio::use_future([&] { return board.async_send(start_motor, 1s, asio::use_future); }))
          .get();
  EXPECT_EQ(sent.get().outcome, Outcome::confirmed);
  auto stopped =
      asio::post(io, asio::use_future([&] { return board.async_stop(1s, asio::use_future); }))
          .get();
  EXPECT_EQ(stopped.get().outcome, Outcome::confirmed);
  io.stop();
  loop.join();
}

TEST_F(AsyncBoardTest, ConfirmsThroughACoroutine) {
  std::vector<Outcome> outcomes;
  auto program = [&]() -> asio::awaitable<void> {
    board.open();
    CommandResult result = co_await board.async_identify(1s, asio::use_awaitable);
    outcomes.push_back(result.outcome);
    EXPECT_EQ(board.identity().board_id, "sim-1");
    for (int i = 0; i < 3; ++i) {
      result = co_await board.async_send(Command::servo(1500 + i, 1), 1s, asio::use_awaitable);
      outcomes.push_back(result.outcome);
    }
    result = co_await board.async_stop(1s, asio::use_awaitable);
    outcomes.push_back(result.outcome);
    result = co_await board.async_send(start_motor, 1s, asio::use_awaitable);
    outcomes.push_back(result.outcome);
    EXPECT_EQ(result.code, Refusal::safe);
    board.close();
  };
  asio::co_spawn(io, program(), [](std::exception_ptr e) { EXPECT_FALSE(e); });
  io.run();
  EXPECT_EQ(outcomes,
            (std::vector<Outcome>{Outcome::confirmed, Outcome::confirmed, Outcome::confirmed,
                                  Outcome::confirmed, Outcome::confirmed, Outcome::refused}));
}

TEST_F(AsyncBoardTest, RunsAHandlerOnItsExecutor) {
  asio::thread_pool pool(1);
  std::atomic<bool> done{false};
  std::thread::id where;
  board.open();
  board.async_send(start_motor, 1s,
                   asio::bind_executor(pool.get_executor(), [&](const CommandResult&) {
                     where = std::this_thread::get_id();
                     done = true;
                   }));
  ASSERT_TRUE(run_until(io, [&] { return done.load(); }));
  EXPECT_NE(where, std::this_thread::get_id());
  board.close();
  pool.join();

  auto strand = asio::make_strand(io);
  bool inside = false;
  board.async_send(start_motor, 1s, asio::bind_executor(strand, [&](const CommandResult& result) {
                     inside = strand.running_in_this_thread();
                     EXPECT_EQ(result.outcome, Outcome::closed) << "the board is closed";
                   }));
  io.restart();
  io.run();
  EXPECT_TRUE(inside);
}

TEST_F(AsyncBoardTest, TakesMoveOnlyHandlers) {
  std::optional<Outcome> outcome;
  board.open();
  board.async_send(start_motor, 1s, [&, owned = std::make_unique<int>(7)](const CommandResult& r) {
    outcome = r.outcome;
    EXPECT_EQ(*owned, 7);
  });
  ASSERT_TRUE(run_until(io, [&] { return outcome.has_value(); }));
}

TEST_F(AsyncBoardTest, HandlersMaySendAgain) {
  int confirmed = 0;
  std::function<void(const CommandResult&)> again = [&](const CommandResult& result) {
    EXPECT_EQ(result.outcome, Outcome::confirmed);
    if (++confirmed < 1000) board.async_identify(1s, again);
  };
  board.open();
  board.async_identify(1s, again);
  ASSERT_TRUE(run_until(io, [&] { return confirmed == 1000; }));
}

TEST_F(AsyncBoardTest, IsNotInTheWayWithSixtyFiveCommands) {
  std::vector<Outcome> outcomes;
  const auto note = [&](const CommandResult& result) { outcomes.push_back(result.outcome); };
  board.open();
  for (std::size_t i = 0; i < Session::max_pending + 1; ++i)
    board.async_send(start_motor, 1s, note);
  ASSERT_TRUE(run_until(io, [&] { return outcomes.size() == Session::max_pending + 1; }));
  EXPECT_EQ(outcomes[0], Outcome::full) << "said at once";
  EXPECT_EQ(std::count(outcomes.begin(), outcomes.end(), Outcome::confirmed),
            static_cast<long>(Session::max_pending));
}

TEST_F(AsyncBoardTest, CloseCancelsAndNoCallbackFollows) {
  std::vector<Outcome> outcomes;
  const auto note = [&](const CommandResult& result) { outcomes.push_back(result.outcome); };
  board.open();
  ASSERT_TRUE(run_until(io, [&] { return board.in_control(); }));
  board.async_send(start_motor, 10s, note);
  board.async_stop(10s, note);
  board.on_state([](const State&, const Datagram&) { ADD_FAILURE() << "called after close()"; });
  board.close();
  board.close();
  board.async_send(start_motor, 1s, note);
  board.async_stop(1s, note);
  EXPECT_FALSE(board.post(start_motor));
  EXPECT_TRUE(outcomes.empty()) << "handlers run on the loop";
  io.restart();
  io.run();  // ends: nothing is left
  const std::vector<Outcome> expected{Outcome::cancelled, Outcome::closed, Outcome::closed,
                                      Outcome::closed};
  EXPECT_EQ(outcomes, expected) << "the stop cancelled the first";
  EXPECT_THROW(board.open(), Error) << "once only";
}

// Everywhere where the user's code runs, the board may be destroyed.
struct DestroyedIn : testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(AsyncBoard, DestroyedIn,
                         testing::Values("handler", "state", "heartbeat", "link", "nack"),
                         [](const auto& place) { return std::string(place.param); });

TEST_P(DestroyedIn, SurvivesIt) {
  const std::string place = GetParam();
  asio::io_context io;
  BoardInAThread over_udp("udp");
  for (const std::string& url : {std::string("sim:"), over_udp.url()}) {
    auto board = std::make_unique<AsyncBoard>(io, url, at_will());
    int cancelled = 0;
    const auto destroy = [&](const auto&...) { board.reset(); };
    if (place == "state") board->on_state(destroy);
    if (place == "heartbeat") board->on_board_heartbeat(destroy);
    if (place == "link") board->on_link(destroy);
    if (place == "nack") board->on_nack(destroy);
    board->open();
    if (place == "handler") {
      board->async_identify(10s, destroy);
    } else if (place == "nack") {
      board->async_stop(1s, [&](const CommandResult&) {
        if (board) board->async_send(start_motor, 1s, [](const CommandResult&) {});
      });
    }
    board->async_send(Command::fields("ENC1"), 10s, [&](const CommandResult& result) {
      cancelled += result.outcome == Outcome::closed ? 1 : 0;
    });
    io.restart();
    io.run();
    EXPECT_FALSE(board);
    EXPECT_EQ(cancelled, 1) << url;
  }
}

// The transport is up at once, and tells so inside of open().
TEST(AsyncBoardEnd, MayComeWhileItOpens) {
  asio::io_context io;
  AsyncBoard closed(io, "sim:");
  closed.on_event([&](const CarrierEvent&) { closed.close(); });
  closed.open();
  auto destroyed = std::make_unique<AsyncBoard>(io, "sim:", at_will());
  destroyed->on_event([&](const CarrierEvent&) { destroyed.reset(); });
  destroyed->open();
  EXPECT_FALSE(destroyed);
  io.run();  // ends: no timer is left
}

TEST(AsyncBoardEnd, IsDestroyedBeforeOrWithoutItsLoop) {
  asio::io_context io;
  bool called = false;
  {
    AsyncBoard board(io, "sim:", at_will());
    board.open();
    board.async_send(start_motor, 1s, [&](const CommandResult&) { called = true; });
  }
  EXPECT_FALSE(called);
  io.run();
  EXPECT_TRUE(called);

  AsyncBoard never_opened(io, "sim:");
  std::optional<Outcome> outcome;
  never_opened.async_stop(1s, [&](const CommandResult& r) { outcome = r.outcome; });
  io.restart();
  io.run();
  EXPECT_EQ(outcome, Outcome::closed);
}

TEST(AsyncBoardEnd, ItsHandlersDieWithTheLoop) {
  const auto payload = std::make_shared<int>(1);
  {
    asio::io_context io;
    AsyncBoard board(io, "sim:", at_will());
    board.open();
    board.async_send(start_motor, 1s, [payload](const CommandResult&) {});
    io.poll();
  }
  EXPECT_EQ(payload.use_count(), 1);
}

TEST_F(AsyncBoardTest, TellsOfEverythingThatComes) {
  int states = 0;
  int heartbeats = 0;
  int links = 0;
  int nacks = 0;
  board.on_state([&](const State&, const Datagram& datagram) {
    EXPECT_TRUE(datagram.has_pnum());
    ++states;
  });
  board.on_board_heartbeat([&](const Datagram&) { ++heartbeats; });
  board.on_link([&](const LinkStatus&) { ++links; });
  board.on_nack([&](const Nack& nack, const Datagram&) {
    EXPECT_EQ(nack.code, Refusal::safe);
    ++nacks;
  });
  board.open();
  board.async_stop(1s, [&](const CommandResult&) {
    board.async_send(start_motor, 1s, [](const CommandResult&) {});
  });
  ASSERT_TRUE(
      run_until(io, [&] { return states > 3 && heartbeats > 1 && links > 1 && nacks > 0; }));
  EXPECT_EQ(board.carrier_counters().rx_oversize, 0U);
  EXPECT_GT(board.carrier_counters().rx_datagrams, 3U);
  EXPECT_EQ(board.name(), "sim:?seed=1");
}

TEST_F(AsyncBoardTest, GatesItsHeartbeatsAndFeedsFromAnyThread) {
  board.watchdog(30ms);
  board.open();
  ASSERT_TRUE(run_until(io, [&] { return board.link().gated(); }));
  std::atomic<bool> stop{false};
  std::thread feeder([&] {
    while (!stop) board.feed();
  });
  EXPECT_TRUE(run_until(io, [&] { return !board.link().gated() && board.in_control(); }));
  stop = true;
  feeder.join();
}

}  // namespace
}  // namespace r4::test
