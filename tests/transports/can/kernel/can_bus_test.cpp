// SPDX-License-Identifier: GPL-3.0-or-later
// The events that CanBus reports to its members, and the calls that members may make during an
// event.
#include "transports/can/can_bus.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <numeric>

#include "tests/transports/can/kernel/can_bus_fixture.hpp"
#include "transports/can/can_socket.hpp"

namespace r4::test {
namespace {

constexpr const char* bus_off = "the controller is bus-off: too many errors";
constexpr const char* warns = "the controller warns of errors";
constexpr const char* passive = "the controller is error-passive";
constexpr const char* over = "the errors have stopped";
constexpr const char* lonely = "no node acknowledges the frames";
constexpr const char* look = "check wiring, termination and bit rate";

using Told = std::vector<std::pair<Kind, std::string>>;
using Bytes = std::vector<std::uint8_t>;

TEST_F(CanBusTest, BusOffIsDownWithAFixAndARestartIsUp) {
  Witness member(bus);
  local.send(error(CAN_ERR_BUSOFF));
  ASSERT_TRUE(run_until([&] { return member.events.size() == 1; }));
  EXPECT_EQ(member.events, (Told{{Kind::down, bus_off}}));
  EXPECT_EQ(member.fix,
            std::string(look) +
                ", then: ip link set vxcan7 type can restart (slcan, gs_usb: down, and up); "
                "with restart-ms 100 the interface restarts by itself");
  EXPECT_FALSE(bus->up());
  local.send(error(CAN_ERR_RESTARTED));
  ASSERT_TRUE(run_until([&] { return member.events.size() == 2; }));
  EXPECT_EQ(member.events.back(), (std::pair<Kind, std::string>{Kind::up, ""}));
  EXPECT_TRUE(bus->up());
}

TEST_F(CanBusTest, FramesOfThisComputerDoNotProveThatTheControllerIsBack) {
  Witness member(bus);
  local.send(error(CAN_ERR_BUSOFF));
  ASSERT_TRUE(run_until([&] { return !bus->up(); }));
  local.send(data(1));
  run_for(soon);
  EXPECT_EQ(member.events, (Told{{Kind::down, bus_off}}));
  EXPECT_TRUE(member.frames.empty()) << "a local frame that did not reach the bus";
  remote.send(data(2));
  ASSERT_TRUE(run_until([&] { return bus->up(); }));
  ASSERT_TRUE(run_until([&] { return !member.frames.empty(); }));
  EXPECT_EQ(member.frames, (Bytes{2}));
  EXPECT_EQ(member.events, (Told{{Kind::down, bus_off}, {Kind::up, ""}}));
}

TEST_F(CanBusTest, AStopOfThisMachineIsHeardDuringBusOff) {
  Witness member(bus);
  bus->join(member, {0x010});
  local.send(error(CAN_ERR_BUSOFF));
  ASSERT_TRUE(run_until([&] { return !bus->up(); }));
  CanFrame stop{};
  stop.id = 0x010;
  local.send(stop);
  ASSERT_TRUE(run_until([&] { return !member.frames.empty(); }));
  EXPECT_FALSE(bus->up());
}

TEST_F(CanBusTest, TroubleIsReportedOnceUntilItChangesOrEnds) {
  Witness member(bus);
  local.send(error(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_WARNING));
  local.send(error(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_WARNING));
  ASSERT_TRUE(run_until([&] { return !member.events.empty(); }));
  EXPECT_EQ(member.fix, look);
  local.send(error(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE));
  local.send(error(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_PASSIVE));
  ASSERT_TRUE(run_until([&] { return member.events.size() == 2; }));
  EXPECT_EQ(member.fix, look);
  EXPECT_TRUE(bus->up());
  local.send(error(CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE));
  local.send(error(CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE));
  ASSERT_TRUE(run_until([&] { return member.events.size() == 3; }));
  run_for(soon);
  EXPECT_EQ(member.events,
            (Told{{Kind::warning, warns}, {Kind::warning, passive}, {Kind::warning, over}}));
}

TEST_F(CanBusTest, NoAcknowledgeIsAWarningUntilAnotherNodeIsHeard) {
  Witness member(bus);
  local.send(error(CAN_ERR_ACK));
  local.send(error(CAN_ERR_ACK));
  ASSERT_TRUE(run_until([&] { return !member.events.empty(); }));
  EXPECT_EQ(member.fix, "check that another node is on the bus, at this bit rate");
  local.send(data(1));
  local.send(error(CAN_ERR_ACK));
  run_for(soon);
  EXPECT_EQ(member.events, (Told{{Kind::warning, lonely}}));
  remote.send(data(2));
  ASSERT_TRUE(run_until([&] { return member.frames.size() == 2; }));
  EXPECT_EQ(member.events.back().second, over);
  local.send(error(CAN_ERR_ACK));
  ASSERT_TRUE(run_until([&] { return member.events.size() == 3; }));
  EXPECT_EQ(member.events.back().second, lonely);
}

TEST_F(CanBusTest, NoAcknowledgeIsNotReportedOfAControllerInTrouble) {
  Witness member(bus);
  local.send(error(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE));
  local.send(error(CAN_ERR_ACK));
  remote.send(data(1));
  ASSERT_TRUE(run_until([&] { return !member.frames.empty(); }));
  EXPECT_EQ(member.events, (Told{{Kind::warning, passive}}));
  local.send(error(CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE));
  ASSERT_TRUE(run_until([&] { return member.events.size() == 2; }));
  EXPECT_EQ(member.events.back().second, over);
}

// --- a host that comes later

TEST_F(CanBusTest, AHostOnABusThatIsDownGetsADownAndLaterAnUpEvent) {
  Witness first(bus);
  local.send(error(CAN_ERR_BUSOFF));
  ASSERT_TRUE(run_until([&] { return !bus->up(); }));
  Recorder told;
  const auto carrier = host();
  carrier->open(told);
  ASSERT_EQ(told.events.size(), 1U);
  EXPECT_EQ(told.events[0].kind, Kind::down);
  EXPECT_EQ(told.events[0].problem.reason, bus_off);
  EXPECT_FALSE(carrier->up());
  local.send(error(CAN_ERR_RESTARTED));
  ASSERT_TRUE(run_until([&] { return told.events.size() == 2; }));
  EXPECT_EQ(told.events[1].kind, Kind::up);
  EXPECT_TRUE(carrier->up());
}

TEST_F(CanBusTest, AHostThatOpensABusInTroubleGetsAWarning) {
  become_passive();
  Recorder told;
  const auto carrier = host();
  carrier->open(told);
  ASSERT_EQ(told.events.size(), 2U);
  EXPECT_EQ(told.events[0].kind, Kind::up);
  EXPECT_EQ(told.events[1].kind, Kind::warning);
  EXPECT_EQ(told.events[1].problem.reason, passive);
}

TEST_F(CanBusTest, AHostThatClosesInTheUpEventGetsNoOtherEvent) {
  become_passive();
  Recorder told;
  const auto carrier = host();
  told.then_event = [&] { carrier->close(); };
  carrier->open(told);
  EXPECT_EQ(told.events.size(), 1U);
  EXPECT_FALSE(carrier->up());
}

TEST_F(CanBusTest, AHostThatOpensInsideAnEventGetsItOnce) {
  Witness first(bus);
  Recorder told;
  const auto carrier = host();
  first.in_event = [&] { carrier->open(told); };
  local.send(error(CAN_ERR_BUSOFF));
  ASSERT_TRUE(run_until([&] { return !bus->up(); }));
  ASSERT_EQ(told.events.size(), 1U);
  EXPECT_EQ(told.events[0].kind, Kind::down);
}

// Netlink fails here because the process has no free descriptor.
TEST_F(CanBusTest, AnUnreadableInterfaceIsNotReportedAsMissing) {
  r4::CanSocket socket(near_end, false);
  rlimit before{};
  ASSERT_EQ(0, ::getrlimit(RLIMIT_NOFILE, &before));
  const int next = ::dup(STDIN_FILENO);
  ASSERT_GE(next, 0);
  ::close(next);
  const rlimit one{static_cast<rlim_t>(next) + 1, before.rlim_max};
  ASSERT_EQ(0, ::setrlimit(RLIMIT_NOFILE, &one));
  const auto refused = error_of([&] { socket.open(); });
  ASSERT_EQ(0, ::setrlimit(RLIMIT_NOFILE, &before));
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->problem().reason.find("the state of the interface is unknown"), 0U)
      << refused->what();
  EXPECT_NE(refused->problem().fix.find("AF_NETLINK"), std::string::npos) << refused->what();
  EXPECT_NO_THROW(socket.open());
}

// The kernel refuses a socket that has more ids than the kernel has filters for.
TEST_F(CanBusTest, IsDownUntilTheKernelAcceptsItsFilters) {
  Witness member(bus);
  Witness greedy(bus);
  std::vector<std::uint32_t> ids(0x700);
  std::iota(ids.begin(), ids.end(), 0U);
  bus->join(greedy, ids);
  EXPECT_TRUE(member.events.empty()) << "reported by the loop, not within join()";
  ASSERT_TRUE(run_until([&] { return !member.events.empty(); }));
  EXPECT_EQ(member.events.back().first, Kind::down);
  EXPECT_EQ(member.events.back().second.find("the kernel does not accept the CAN filters"), 0U);
  EXPECT_NE(member.fix.find("fewer nodes"), std::string::npos);
  run_for(soon);  // during this time the bus tries again
  EXPECT_FALSE(bus->up());
  EXPECT_EQ(member.events.size(), 1U);
  greedy.leave();
  ASSERT_TRUE(run_until([&] { return bus->up(); }));
  remote.send(data(7));
  ASSERT_TRUE(run_until([&] { return !member.frames.empty(); }));
  EXPECT_EQ(member.frames, (Bytes{7}));
}

TEST_F(CanBusTest, ReportsDownThenMissingThenUpOnceEach) {
  Witness member(bus);
  ASSERT_EQ(0, std::system("ip link set vxcan7 down"));
  ASSERT_TRUE(run_until([&] { return !bus->up(); }));
  TearDownTestSuite();
  ASSERT_TRUE(run_until([&] { return member.events.size() == 2; }));
  EXPECT_EQ(member.events.back(),
            (std::pair<Kind, std::string>{Kind::warning, "there is no interface vxcan7"}));
  EXPECT_EQ(member.fix.find("plug its adapter in"), 0U) << member.fix;
  SetUpTestSuite();
  ASSERT_TRUE(run_until([&] { return bus->up(); }));
  EXPECT_EQ(member.events.size(), 3U);
  EXPECT_EQ(member.events.back().first, Kind::up);
}

TEST_F(CanBusTest, CountsFramesThatTheControllerLost) {
  Witness member(bus);
  EXPECT_EQ(bus->overflows(), 0U);
  local.send(error(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_OVERFLOW));
  local.send(data(1));
  ASSERT_TRUE(run_until([&] { return !member.frames.empty(); }));
  EXPECT_EQ(bus->overflows(), 1U);
  EXPECT_TRUE(member.events.empty()) << "an overflow is counted, not reported";

  Recorder told;
  const auto carrier = host();
  carrier->open(told);
  EXPECT_EQ(carrier->counters().rx_overflows, 1U);
  carrier->close();
  EXPECT_EQ(carrier->counters().rx_overflows, 1U) << "the counter stays after close()";
}

TEST_F(CanBusTest, MembersMayLeaveInsideADownEvent) {
  Witness first(bus), second(bus), third(bus), fourth(bus);
  second.in_event = [&] {
    first.leave();   // was called already
    second.leave();  // is being called
    third.leave();   // would be called next
  };
  local.send(error(CAN_ERR_BUSOFF));
  ASSERT_TRUE(run_until([&] { return !fourth.events.empty(); }));
  EXPECT_EQ(first.events.size(), 1U);
  EXPECT_EQ(second.events.size(), 1U);
  EXPECT_TRUE(third.events.empty());
  local.send(error(CAN_ERR_RESTARTED));
  ASSERT_TRUE(run_until([&] { return fourth.events.size() == 2; }));
  EXPECT_EQ(first.events.size() + second.events.size() + third.events.size(), 2U);
}

TEST_F(CanBusTest, MembersMayLeaveInsideAFrame) {
  Witness first(bus), second(bus), third(bus), fourth(bus);
  second.in_frame = [&] {
    first.leave();
    second.leave();
    third.leave();
  };
  for (const std::uint8_t byte : Bytes{1, 2, 3}) local.send(data(byte));
  ASSERT_TRUE(run_until([&] { return fourth.frames.size() == 3; }));
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
  ASSERT_TRUE(run_until([&] { return gone.expired(); }));
  EXPECT_EQ(member->frames, (Bytes{1}));

  member = std::make_unique<Witness>(CanBus::of(io, near_end, false));
  member->in_event = [&] { member->leave(); };
  local.send(error(CAN_ERR_BUSOFF));
  ASSERT_TRUE(run_until([&] { return !member->events.empty(); }));
  run_for(soon);
  EXPECT_EQ(member->events.size(), 1U);
}

TEST_F(CanBusTest, AMemberMayJoinInsideACallback) {
  Witness first(bus);
  std::unique_ptr<Witness> second;
  first.in_frame = [&] {
    if (!second) second = std::make_unique<Witness>(bus);
  };
  for (const std::uint8_t byte : Bytes{1, 2}) local.send(data(byte));
  ASSERT_TRUE(run_until([&] { return first.frames.size() == 2; }));
  EXPECT_EQ(second->frames.back(), 2);
}

}  // namespace
}  // namespace r4::test
