// SPDX-License-Identifier: GPL-3.0-or-later
// Boards on transports that the program implements, whose calls may wait
// (r4link/transports/own_transport.hpp).
#include <gtest/gtest.h>

#include <asio/executor_work_guard.hpp>
#include <asio/io_context.hpp>
#include <asio/post.hpp>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "firmware/ports/sim/simulated_board.hpp"
#include "host/board_loop.hpp"
#include "r4link/board.hpp"
#include "r4link/can/can_ids.hpp"
#include "r4link/transports/own_transport.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/first.hpp"
#include "transports/own/own_carriers.hpp"

namespace r4::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

// One end of a memory transport, with faults. Holds the function that receives the datagrams of the
// other end.
template <class Received>
class End {
 public:
  void begin(Received received) {
    const std::lock_guard lock(mutex_);
    if (opens) throw std::runtime_error("no modem");
    received_ = std::move(received);
    ++openings;
  }
  void finish() {
    const std::lock_guard lock(mutex_);
    closed_ = std::exchange(received_, nullptr);
    ++closings;
  }
  template <class... Parts>
  void hand_over(Parts... parts) {
    const std::lock_guard lock(mutex_);
    if (received_) received_(parts...);
  }
  // A reader may deliver data after its transport has closed.
  template <class... Parts>
  void hand_over_late(Parts... parts) {
    const std::lock_guard lock(mutex_);
    if (closed_) closed_(parts...);
  }
  void may_throw() const {
    if (fails) throw std::runtime_error("the modem is gone");
  }

  std::atomic<bool> opens{false};  // true: open() throws
  std::atomic<bool> fails{false};
  std::atomic<int> openings{0};
  std::atomic<int> closings{0};

 private:
  std::mutex mutex_;
  Received received_;
  Received closed_;  // receiver of the last opening that was closed
};

struct Modem final : OwnTransport, End<OwnTransport::Received> {
  std::string name() const override { return "modem"; }
  void open(OwnTransport::Received received) override { begin(std::move(received)); }
  void send(std::string_view datagram) override {
    may_throw();
    ++sent;
    if (hold) return hold.wait(true);
    if (other != nullptr) other->hand_over(datagram);
  }
  void close() override { finish(); }

  std::atomic<bool> hold{false};
  std::atomic<int> sent{0};
  Modem* other = nullptr;
};

struct Frame {
  std::uint32_t id;
  bool extended;
};

struct Adapter final : OwnCanBus, End<OwnCanBus::Received> {
  std::string name() const override { return "adapter"; }
  void open(OwnCanBus::Received received) override { begin(std::move(received)); }
  void send(std::uint32_t id, bool extended, bool fd, std::string_view data) override {
    may_throw();
    {
      const std::lock_guard lock(mutex);
      frames.push_back({id, extended});
    }
    if (other != nullptr) other->hand_over(id, extended, fd, data);
  }
  void close() override { finish(); }

  bool has_sent(std::uint32_t id, bool extended) {
    const std::lock_guard lock(mutex);
    for (const Frame& each : frames) {
      if (each.extended == extended && each.id == id) return true;
    }
    return false;
  }

  std::mutex mutex;
  std::vector<Frame> frames;
  Adapter* other = nullptr;
};

// A simulated board on a separate thread, on the carrier that `make(io, loop)` makes.
class SimulatedEnd {
 public:
  template <class Make>
  explicit SimulatedEnd(Make make) {
    board_ = std::make_unique<sim::SimulatedBoard>(io_, sim::SimulatedBoard::Options());
    board_->add_carrier(make(io_, loop_));
    board_->start();
    thread_ = std::thread([this] { io_.run(); });
  }
  ~SimulatedEnd() {
    asio::post(io_, [this] {
      board_.reset();
      work_.reset();
    });
    thread_.join();
  }
  SimulatedEnd(const SimulatedEnd&) = delete;
  SimulatedEnd& operator=(const SimulatedEnd&) = delete;

 private:
  asio::io_context io_;
  asio::executor_work_guard<asio::io_context::executor_type> work_ = asio::make_work_guard(io_);
  BoardLoop loop_{io_};
  std::unique_ptr<sim::SimulatedBoard> board_;
  std::thread thread_;
};

template <class Own>
struct Pair {
  Pair() {
    here->other = there.get();
    there->other = here.get();
  }
  std::shared_ptr<Own> here = std::make_shared<Own>();
  std::shared_ptr<Own> there = std::make_shared<Own>();
};

struct ModemBench : Pair<Modem> {
  SimulatedEnd board{
      [this](asio::io_context&, Loop& loop) { return make_own_carrier(loop, there); }};
};
struct CanBench : Pair<Adapter> {
  explicit CanBench(OwnCanNode node = {}) : is(node) {}
  OwnCanNode is;
  SimulatedEnd board{[this](asio::io_context& io, Loop&) {
    return make_own_can_carrier(io, there, is, Role::board);
  }};
};

template <class Condition>
bool comes(Condition condition) {
  const auto deadline = std::chrono::steady_clock::now() + seconds(5);
  while (!condition() && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(milliseconds(2));
  }
  return condition();
}

TEST(OwnTransports, CarryCommandsAndStopsToABoard) {
  ModemBench bench;
  {
    Board board(carrier_on(bench.here), at_will());
    board.wait_active();
    EXPECT_EQ(board.name(), "modem");
    EXPECT_NO_THROW(board.send("O:358,1,1"));
    EXPECT_NO_THROW(board.stop());
    EXPECT_GT(board.carrier_counters().tx_datagrams, 2U);
    EXPECT_GT(board.carrier_counters().rx_datagrams, 2U);
  }
  EXPECT_EQ(bench.here->closings, 1);
}

TEST(OwnTransports, AnErrorOfTheFirstOpenIsThrownByTheBoardConstructor) {
  const auto modem = std::make_shared<Modem>();
  modem->opens = true;
  try {
    const Board board(carrier_on(modem));
    ADD_FAILURE() << "the transport opened, although it must fail";
  } catch (const Error& error) {
    EXPECT_EQ(error.problem().thing, "modem");
    EXPECT_EQ(error.problem().reason, "no modem");
  }
  EXPECT_EQ(modem->closings, 0);
}

TEST(OwnTransports, ATransportIsDownAfterItsSendThrewUntilItReopens) {
  ModemBench bench;
  const First<std::string> down;
  BoardCallbacks callbacks;
  callbacks.on_event = [down](const CarrierEvent& event) {
    if (event.kind == CarrierEvent::Kind::down) down.set(event.problem.reason);
  };
  Board board(carrier_on(bench.here), at_will(), callbacks);
  board.wait_active();
  bench.here->opens = true;
  bench.here->fails = true;
  EXPECT_EQ(down.get(), "the modem is gone");
  ASSERT_TRUE(comes([&] { return board.link().state != HostLinkState::active; }));
  bench.here->fails = false;
  bench.here->opens = false;
  board.wait_active(seconds(5));
  EXPECT_EQ(bench.here->openings, 2);
  EXPECT_EQ(bench.here->closings, 1);
}

TEST(OwnTransports, APathThatCannotBeOpenedAtFirstJoinsLater) {
  ModemBench bench;
  const auto late = std::make_shared<Modem>();
  late->opens = true;
  Board board(std::vector{carrier_on(bench.here), carrier_on(late)}, at_will());
  board.wait_active();
  EXPECT_NO_THROW(board.send("O:358,1,1"));
  late->opens = false;
  EXPECT_TRUE(comes([&] { return late->sent > 0; }));
}

// A carrier on a modem, whose loop the test runs.
struct HeardModem final : Carrier::Handler {
  void on_datagram(std::string_view bytes, Peer) override { heard.emplace_back(bytes); }
  void on_carrier_event(const CarrierEvent&) override {}
  bool opens() {
    try {
      carrier->open(*this);
      return true;
    } catch (const Error&) {
      return false;
    }
  }
  template <class Condition>
  bool polls_until(Condition condition) {
    return comes([&] {
      io.restart();
      io.poll();
      return condition();
    });
  }

  asio::io_context io;
  BoardLoop loop{io};
  std::shared_ptr<Modem> modem = std::make_shared<Modem>();
  std::unique_ptr<Carrier> carrier = make_own_carrier(loop, modem);
  std::vector<std::string> heard;
};

TEST(OwnTransports, APathThatJoinsLaterDoesNotDeliverWhatWasReceivedBefore) {
  HeardModem host;
  host.modem->opens = true;
  EXPECT_FALSE(host.opens());
  host.modem->opens = false;
  ASSERT_TRUE(comes([&] { return host.modem->openings == 1; }));
  host.modem->hand_over("old");
  ASSERT_TRUE(comes([&] { return host.carrier->up() || host.opens(); }));
  host.modem->hand_over("new");
  EXPECT_TRUE(host.polls_until([&] { return !host.heard.empty() && host.heard.back() == "new"; }));
  EXPECT_EQ(host.heard, std::vector<std::string>{"new"});
}

TEST(OwnTransports, AReopenedTransportDeliversNothingOfTheEarlierOpening) {
  HeardModem host;
  ASSERT_TRUE(host.opens());
  host.modem->fails = true;
  host.carrier->send("lost", Priority::normal);
  ASSERT_TRUE(comes([&] { return host.modem->openings == 2; }));
  host.modem->hand_over_late("old");
  host.modem->hand_over("new");
  EXPECT_TRUE(host.polls_until([&] { return !host.heard.empty() && host.heard.back() == "new"; }));
  EXPECT_EQ(host.heard, std::vector<std::string>{"new"});
}

TEST(OwnTransports, ASendThatDoesNotReturnDoesNotBlockTheBoard) {
  ModemBench bench;
  std::optional<Board> board(std::in_place, carrier_on(bench.here), at_will());
  board->wait_active();
  bench.here->hold = true;
  EXPECT_THROW(board->send("O:358,1,1", milliseconds(50)), Error);
  board.reset();  // must return although send() is waiting
  bench.here->hold = false;
  bench.here->hold.notify_all();
}

TEST(OwnTransports, RefuseTooLongADatagramFromTheDevice) {
  ModemBench bench;
  const Board board(carrier_on(bench.here), at_will());
  EXPECT_THROW(bench.here->hand_over(std::string(max_datagram + 1, 'x')), Error);
  EXPECT_NO_THROW(bench.here->hand_over(std::string(max_datagram, '\0')));
}

TEST(OwnTransports, ACanBusCarriesCommandsAndTheEmergencyStopOfANode) {
  for (const bool fd : {false, true}) {
    CanBench bench({.node = 3, .fd = fd});
    Board board(carrier_on(bench.here, {.node = 3, .fd = fd}), at_will());
    board.wait_active(seconds(5));
    EXPECT_EQ(board.name(), "adapter, node 3");
    EXPECT_NO_THROW(board.send("O:358,1,1"));
    EXPECT_TRUE(bench.here->has_sent(command_id(3), false));
    EXPECT_NO_THROW(board.stop());
    EXPECT_TRUE(bench.here->has_sent(emergency_stop_id, false));
    EXPECT_GT(board.carrier_counters().transfers->packed, 0U);
  }
}

TEST(OwnTransports, ACanBusIsDownAfterAFailureUntilItReopens) {
  CanBench bench;
  const First<std::string> down;
  BoardCallbacks callbacks;
  callbacks.on_event = [down](const CarrierEvent& event) {
    if (event.kind == CarrierEvent::Kind::down) down.set(event.problem.reason);
  };
  Board board(carrier_on(bench.here), at_will(), callbacks);
  board.wait_active(seconds(5));
  bench.here->opens = true;
  bench.here->fails = true;
  EXPECT_EQ(down.get(), "the modem is gone");
  ASSERT_TRUE(comes([&] { return board.link().state != HostLinkState::active; }));
  bench.here->fails = false;
  bench.here->opens = false;
  board.wait_active(seconds(5));
  EXPECT_NO_THROW(board.send("O:358,1,1"));
  EXPECT_EQ(bench.here->openings, 2);
}

TEST(OwnTransports, RefuseTooLongACanFrameAndANodeOutOfRange) {
  CanBench bench;
  const Board board(carrier_on(bench.here), at_will());
  const std::string nine(9, 'x');
  EXPECT_THROW(bench.here->hand_over(1U, false, false, std::string_view(nine)), Error);
  EXPECT_NO_THROW(bench.here->hand_over(1U, false, true, std::string_view(nine)));
  EXPECT_THROW(Board(carrier_on(std::make_shared<Adapter>(), {.node = 32})), Error);
}

}  // namespace
}  // namespace r4::test
