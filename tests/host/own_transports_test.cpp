// SPDX-License-Identifier: GPL-3.0-or-later
// Boards on transports that the program implements, whose calls may wait
// (r4link/transports/own_transport.hpp), and on the carrier of docs/examples/own_transport.
#include <gtest/gtest.h>
#include <sys/socket.h>

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
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "docs/examples/own_transport/socket_carrier.hpp"
#include "firmware/ports/sim/simulated_board.hpp"
#include "host/board_loop.hpp"
#include "r4link/board.hpp"
#include "r4link/can/can_ids.hpp"
#include "r4link/transports/own_transport.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/first.hpp"
#include "tests/support/problems.hpp"
#include "transports/file_descriptor.hpp"
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
    if (hold) return hold.wait(true);
    if (other != nullptr) other->hand_over(datagram);
  }
  void close() override { finish(); }

  std::atomic<bool> hold{false};
  Modem* other = nullptr;
};

struct Adapter final : OwnCanBus, End<OwnCanBus::Received> {
  std::string name() const override { return "adapter"; }
  void open(OwnCanBus::Received received) override { begin(std::move(received)); }
  void send(std::uint32_t id, bool extended, bool fd, std::string_view data) override {
    may_throw();
    if (!extended) {
      const std::lock_guard lock(mutex);
      ids.insert(id);
    }
    if (other != nullptr) other->hand_over(id, extended, fd, data);
  }
  void close() override { finish(); }

  bool has_sent(std::uint32_t id) {
    const std::lock_guard lock(mutex);
    return ids.contains(id);
  }

  std::mutex mutex;
  std::set<std::uint32_t> ids;  // 11-bit ids of the sent frames
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

// The transport of docs/examples/own_transport.
struct SocketBench {
  SocketBench() {
    int ends[2];
    EXPECT_EQ(0, ::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends));
    here.reset(ends[0]);
    there.reset(ends[1]);
    board.emplace([this](asio::io_context&, Loop& loop) { return carrier(loop, there); });
  }
  CarrierMaker host_end() {
    return [this](Loop& loop) { return carrier(loop, here); };
  }
  static std::unique_ptr<Carrier> carrier(Loop& loop, const FileDescriptor& socket) {
    return std::make_unique<SocketCarrier>(loop, socket.get());
  }
  FileDescriptor here;
  FileDescriptor there;
  std::optional<SimulatedEnd> board;
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
  const Problem problem = problem_of([&] { const Board board(carrier_on(modem)); });
  EXPECT_EQ(problem.thing, "modem");
  EXPECT_EQ(problem.reason, "no modem");
  EXPECT_EQ(modem->closings, 0);
}

// The callbacks of a board that report to `down` why its transport is down.
BoardCallbacks noting(const First<std::string>& down) {
  BoardCallbacks callbacks;
  callbacks.on_event = [down](const CarrierEvent& event) {
    if (event.kind == CarrierEvent::Kind::down) down.set(event.problem.reason);
  };
  return callbacks;
}

template <class Bench>
void expect_down_until_reopened(Bench& bench) {
  const First<std::string> down;
  Board board(carrier_on(bench.here), at_will(), noting(down));
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
  EXPECT_EQ(bench.here->closings, 1);
}

TEST(OwnTransports, ATransportIsDownAfterItsSendThrewUntilItReopens) {
  ModemBench bench;
  expect_down_until_reopened(bench);
}

TEST(OwnTransports, ACanBusIsDownAfterAFailureUntilItReopens) {
  CanBench bench;
  expect_down_until_reopened(bench);
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
  // Hands "new" over, and expects that the carrier delivers nothing else.
  void expect_only_new() {
    modem->hand_over("new");
    EXPECT_TRUE(comes([&] {
      io.restart();
      io.poll();
      return !heard.empty() && heard.back() == "new";
    }));
    EXPECT_EQ(heard, std::vector<std::string>{"new"});
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
  host.expect_only_new();
}

TEST(OwnTransports, AReopenedTransportDeliversNothingOfTheEarlierOpening) {
  HeardModem host;
  ASSERT_TRUE(host.opens());
  host.modem->fails = true;
  host.carrier->send("lost", Priority::normal);
  ASSERT_TRUE(comes([&] { return host.modem->openings == 2; }));
  host.modem->hand_over_late("old");
  host.expect_only_new();
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
    EXPECT_TRUE(bench.here->has_sent(command_id(3)));
    EXPECT_NO_THROW(board.stop());
    EXPECT_TRUE(bench.here->has_sent(emergency_stop_id));
    EXPECT_GT(board.carrier_counters().transfers->packed, 0U);
  }
}

TEST(OwnTransports, RefuseTooLongACanFrameAndANodeOutOfRange) {
  CanBench bench;
  const Board board(carrier_on(bench.here), at_will());
  const std::string nine(9, 'x');
  EXPECT_THROW(bench.here->hand_over(1U, false, false, std::string_view(nine)), Error);
  EXPECT_NO_THROW(bench.here->hand_over(1U, false, true, std::string_view(nine)));
  EXPECT_THROW(Board(carrier_on(std::make_shared<Adapter>(), {.node = 32})), Error);
}

TEST(OwnTransports, TheExampleCarriesCommandsAndStopsUntilTheOtherProgramCloses) {
  SocketBench bench;
  const First<std::string> down;
  Board board(bench.host_end(), at_will(), noting(down));
  board.wait_active();
  EXPECT_EQ(board.name(), "radio");
  EXPECT_NO_THROW(board.send("O:358,1,1"));
  EXPECT_NO_THROW(board.stop());
  bench.board.reset();
  EXPECT_EQ(down.get(), "the other end was closed");
}

}  // namespace
}  // namespace r4::test
