// SPDX-License-Identifier: GPL-3.0-or-later
// What CanBus tells its members, and what they may do meanwhile. On a vxcan pair of its own: what
// comes from the far end is from another machine to it, what is sent on the near one is local. For
// tools/with-can.
#include "transports/can_bus.hpp"

#include <gtest/gtest.h>
#include <linux/can/error.h>

#include <algorithm>
#include <asio/io_context.hpp>
#include <chrono>
#include <cstdlib>
#include <functional>
#include <initializer_list>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/can/raw_can.hpp"

namespace r4 {
namespace {

using Kind = CarrierEvent::Kind;

constexpr char near_end[] = "vxcan7";
constexpr char far_end[] = "vxcan8";
constexpr std::uint32_t heard_id = 0x183;
constexpr std::uint32_t other_id = 0x555;
constexpr std::chrono::milliseconds soon{200};
constexpr std::chrono::seconds patience{5};

constexpr const char* bus_off = "the controller is bus-off: too many errors";
constexpr const char* warns = "the controller warns of errors";
constexpr const char* passive = "the controller is error-passive";
constexpr const char* over = "the trouble is over";
constexpr const char* lonely = "nobody acknowledges";
constexpr const char* look = "look at wiring, termination and bit rate";

// The two interfaces, as long as the tests of this file run.
class CanBusTest : public testing::Test {
 public:
  static void SetUpTestSuite() {
    remove();
    ASSERT_EQ(0, std::system("ip link add dev vxcan7 type vxcan peer name vxcan8 && "
                             "ip link set vxcan7 up && ip link set vxcan8 up"))
        << "it takes root, and vxcan in the kernel: tools/with-can";
  }
  static void TearDownTestSuite() { remove(); }

 protected:
  void run_until(const std::function<bool()>& is_so) {
    const auto end = std::chrono::steady_clock::now() + patience;
    while (!is_so()) {
      io.restart();
      ASSERT_NE(0U, io.run_one_until(end)) << "it did not come";
    }
  }
  void run_for(std::chrono::milliseconds time) {
    io.restart();
    io.run_for(time);
  }

  static CanFrame data(std::uint8_t byte) {
    CanFrame frame{};
    frame.id = heard_id;
    frame.size = 1;
    frame.data[0] = byte;
    return frame;
  }
  static CanFrame error(std::uint32_t classes, std::uint8_t controller = 0) {
    CanFrame frame{};
    frame.id = CAN_ERR_FLAG | classes;
    frame.size = CAN_ERR_DLC;
    frame.data[1] = controller;
    return frame;
  }

  asio::io_context io{1};
  test::RawCan local{other_id, near_end};
  test::RawCan remote{other_id, far_end};
  std::shared_ptr<CanBus> bus = CanBus::of(io, near_end, false);

 private:
  static void remove() { (void)std::system("ip link del vxcan7 2>/dev/null"); }
};

// Writes down what it is told.
class Witness final : public CanBus::Member {
 public:
  explicit Witness(std::shared_ptr<CanBus> bus) : bus_(std::move(bus)) {
    bus_->join(*this, {heard_id});
  }
  ~Witness() { leave(); }
  Witness(const Witness&) = delete;
  Witness& operator=(const Witness&) = delete;

  void leave() {
    if (bus_) bus_->leave(*this);
    bus_.reset();
  }

  std::vector<std::pair<Kind, std::string>> events;
  std::string fix;  // of the newest event
  std::vector<std::uint8_t> frames;
  std::function<void()> in_event = [] {};
  std::function<void()> in_frame = [] {};

 private:
  void on_frame(const CanFrame& frame, std::uint32_t) override {
    EXPECT_TRUE(bus_) << "it has left";
    frames.push_back(frame.data[0]);
    in_frame();
  }
  void on_bus(const CarrierEvent& event) override {
    EXPECT_TRUE(bus_) << "it has left";
    events.emplace_back(event.kind, event.problem.reason);
    fix = event.problem.fix;
    EXPECT_EQ(event.problem.thing, std::string("can://") + near_end);
    in_event();
  }
  void on_drained() override {}
  bool offer(std::uint32_t, CanFrame&) override { return false; }
  bool offer_urgent(std::uint32_t, CanFrame&) override { return false; }
  void frame_sent(std::uint32_t) override {}
  void on_sent() override {}
  void on_stuck() override {}

  std::shared_ptr<CanBus> bus_;
};

using Told = std::vector<std::pair<Kind, std::string>>;
using Bytes = std::vector<std::uint8_t>;

TEST_F(CanBusTest, BusOffIsDownWithTheWayOutAndARestartIsUp) {
  Witness member(bus);
  local.send(error(CAN_ERR_BUSOFF));
  run_until([&] { return member.events.size() == 1; });
  EXPECT_EQ(member.events, (Told{{Kind::down, bus_off}}));
  EXPECT_EQ(member.fix, std::string(look) +
                            ", then: ip link set vxcan7 type can restart (slcan: down, and up); "
                            "with restart-ms 100 it does so by itself");
  EXPECT_FALSE(bus->up());
  local.send(error(CAN_ERR_RESTARTED));
  run_until([&] { return member.events.size() == 2; });
  EXPECT_EQ(member.events.back(), (std::pair<Kind, std::string>{Kind::up, ""}));
  EXPECT_TRUE(bus->up());
}

TEST_F(CanBusTest, OtherProcessesOfThisMachineDoNotProveThatTheControllerIsBack) {
  Witness member(bus);
  local.send(error(CAN_ERR_BUSOFF));
  run_until([&] { return !bus->up(); });
  local.send(data(1));
  run_for(soon);
  EXPECT_EQ(member.events, (Told{{Kind::down, bus_off}}));
  EXPECT_TRUE(member.frames.empty()) << "what did not get to the bus";
  remote.send(data(2));
  run_until([&] { return bus->up(); });
  run_until([&] { return !member.frames.empty(); });
  EXPECT_EQ(member.frames, (Bytes{2}));
  EXPECT_EQ(member.events, (Told{{Kind::down, bus_off}, {Kind::up, ""}}));
}

TEST_F(CanBusTest, AStopOfThisMachineIsHeardDuringBusOff) {
  Witness member(bus);
  bus->join(member, {0x010});
  local.send(error(CAN_ERR_BUSOFF));
  run_until([&] { return !bus->up(); });
  CanFrame stop{};
  stop.id = 0x010;
  local.send(stop);
  run_until([&] { return !member.frames.empty(); });
  EXPECT_FALSE(bus->up());
}

TEST_F(CanBusTest, TroubleIsToldOnceUntilItChangesAndWhenItIsOver) {
  Witness member(bus);
  local.send(error(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_WARNING));
  local.send(error(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_WARNING));
  run_until([&] { return !member.events.empty(); });
  EXPECT_EQ(member.fix, look);
  local.send(error(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE));
  local.send(error(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_PASSIVE));
  run_until([&] { return member.events.size() == 2; });
  EXPECT_EQ(member.fix, look);
  EXPECT_TRUE(bus->up());
  local.send(error(CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE));
  local.send(error(CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE));
  run_until([&] { return member.events.size() == 3; });
  run_for(soon);
  EXPECT_EQ(member.events,
            (Told{{Kind::warning, warns}, {Kind::warning, passive}, {Kind::warning, over}}));
}

TEST_F(CanBusTest, NoAcknowledgeIsAWarningUntilAnotherNodeIsHeard) {
  Witness member(bus);
  local.send(error(CAN_ERR_ACK));
  local.send(error(CAN_ERR_ACK));
  run_until([&] { return !member.events.empty(); });
  EXPECT_EQ(member.fix, "see that another node is on the bus, at this bit rate");
  local.send(data(1));
  local.send(error(CAN_ERR_ACK));
  run_for(soon);
  EXPECT_EQ(member.events, (Told{{Kind::warning, lonely}}));
  remote.send(data(2));
  run_until([&] { return member.frames.size() == 2; });
  EXPECT_EQ(member.events.back().second, over);
  local.send(error(CAN_ERR_ACK));
  run_until([&] { return member.events.size() == 3; });
  EXPECT_EQ(member.events.back().second, lonely);
}

TEST_F(CanBusTest, MembersMayLeaveInsideADownEventAndNobodyIsSkipped) {
  Witness first(bus), second(bus), third(bus), fourth(bus);
  second.in_event = [&] {
    first.leave();   // was told
    second.leave();  // is being told
    third.leave();   // would be next
  };
  local.send(error(CAN_ERR_BUSOFF));
  run_until([&] { return !fourth.events.empty(); });
  EXPECT_EQ(first.events.size(), 1U);
  EXPECT_EQ(second.events.size(), 1U);
  EXPECT_TRUE(third.events.empty());
  local.send(error(CAN_ERR_RESTARTED));
  run_until([&] { return fourth.events.size() == 2; });
  EXPECT_EQ(first.events.size() + second.events.size() + third.events.size(), 2U);
}

TEST_F(CanBusTest, MembersMayLeaveInsideAFrameAndNobodyIsSkipped) {
  Witness first(bus), second(bus), third(bus), fourth(bus);
  second.in_frame = [&] {
    first.leave();
    second.leave();
    third.leave();
  };
  for (const std::uint8_t byte : Bytes{1, 2, 3}) local.send(data(byte));
  run_until([&] { return fourth.frames.size() == 3; });
  EXPECT_EQ(first.frames, (Bytes{1}));
  EXPECT_EQ(second.frames, (Bytes{1}));
  EXPECT_TRUE(third.frames.empty());
  EXPECT_EQ(fourth.frames, (Bytes{1, 2, 3}));
}

TEST_F(CanBusTest, TheLastMemberMayLeaveInsideACall) {
  const std::weak_ptr<CanBus> gone = bus;
  auto member = std::make_unique<Witness>(std::exchange(bus, nullptr));
  member->in_frame = [&] { member->leave(); };
  for (const std::uint8_t byte : Bytes{1, 2, 3}) local.send(data(byte));
  run_until([&] { return gone.expired(); });
  EXPECT_EQ(member->frames, (Bytes{1}));

  member = std::make_unique<Witness>(CanBus::of(io, near_end, false));
  member->in_event = [&] { member->leave(); };
  local.send(error(CAN_ERR_BUSOFF));
  run_until([&] { return !member->events.empty(); });
  run_for(soon);
  EXPECT_EQ(member->events.size(), 1U);
}

TEST_F(CanBusTest, OneWhoJoinsInsideACallIsCalledFromThenOn) {
  Witness first(bus);
  std::unique_ptr<Witness> second;
  first.in_frame = [&] {
    if (!second) second = std::make_unique<Witness>(bus);
  };
  for (const std::uint8_t byte : Bytes{1, 2}) local.send(data(byte));
  run_until([&] { return first.frames.size() == 2; });
  EXPECT_EQ(second->frames.back(), 2);
}

}  // namespace
}  // namespace r4
