// SPDX-License-Identifier: GPL-3.0-or-later
// How the stops of a program reach a CAN bus: which stops are merged into one, and how each stop is
// confirmed. The carriers and the loop are real, and the bus is exact to the bit.
#include <gtest/gtest.h>

#include <asio/io_context.hpp>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "modelled_controller.hpp"
#include "tests/support/datagrams.hpp"
#include "transports/can/can_bus.hpp"
#include "transports/can/can_carrier.hpp"
#include "transports/framing/can/can_node.hpp"

namespace r4::test {
namespace {

using Texts = std::vector<std::string>;

// The hosts of the boards 3 and 4 in one program, and the frames on their bus.
class ProgramOnABus : public testing::Test, private Carrier::Handler {
 protected:
  ProgramOnABus() {
    CanNodeOptions boards;
    boards.received = [this](const CanFrame& frame) { frames_.push_back(frame); };
    boards_ = bus_.add_node(std::move(boards));
    for (const char* const url : {"can://model?node=3", "can://model?node=4"}) {
      hosts_.push_back(make_can_carrier(io_, Url::parse(url), Role::host));
      hosts_.back()->open(*this);
    }
  }

  void stop(std::size_t host, std::uint32_t pnum) {
    const std::string bytes = with_crc("E:STOP;PNum:" + std::to_string(pnum) + ";");
    EXPECT_EQ(hosts_[host]->send(bytes, Priority::stop), SendResult::sent);
  }
  // Runs the loop and the bus until nothing is pending.
  void settle() {
    for (int i = 0; i < 4; ++i) {
      io_.restart();
      io_.poll();
      controller_.pump();
      bus_.run_until(bus_.now_ns() + ms_ns);
    }
  }
  void pass(std::chrono::milliseconds time) {
    io_.restart();
    io_.run_for(time);
  }
  // The stops on the bus since the last call: "bare", or "numbered".
  Texts stops() {
    settle();
    Texts stops;
    for (const CanFrame& frame : std::exchange(frames_, {})) {
      if (classify(frame).kind != CanIdKind::emergency_stop) continue;
      stops.push_back(frame.extended ? "numbered" : "bare");
      if (frame.extended) number_ = short_stop_number(frame.id);
    }
    return stops;
  }
  // The board reports that it has obeyed the last stop. Returns the datagrams that its host
  // receives.
  Texts confirmed_by(std::uint8_t board) {
    const std::string says = heartbeat(number_);
    CanNode node(CanEnd::board, board, false);
    EXPECT_TRUE(node.begin(Text(says), bus_.now_us()));
    CanFrame frame{};
    while (node.offer(bus_.now_us(), frame)) {
      bus_.send(boards_, frame);
      node.frame_sent(bus_.now_us());
      bus_.run_until(bus_.now_ns() + ms_ns);
    }
    settle();
    return std::exchange(heard_, {});
  }
  static std::string heartbeat(std::uint32_t number) {
    return with_crc("H:R4-ROS2;PNum:9;T:90;SAFE:2;CAUSE:7;STOP:" + std::to_string(number) + ";");
  }

  std::uint32_t number_ = 0;

 private:
  static constexpr std::uint64_t ms_ns = 1000000;

  void on_datagram(std::string_view bytes, Peer) override { heard_.emplace_back(bytes); }
  void on_carrier_event(const CarrierEvent&) override {}

  asio::io_context io_;
  CanBusModel bus_{{.rate = {1000000, 0}, .seed = 1}};
  ModelledController controller_{bus_, {}};
  int boards_ = 0;
  std::vector<CanFrame> frames_;
  Texts heard_;
  std::vector<std::unique_ptr<Carrier>> hosts_;
};

TEST_F(ProgramOnABus, StopsOfSeveralBoardsInOneTurnShareOneStopOnTheBus) {
  stop(0, 3000000001);
  stop(1, 77);
  EXPECT_EQ(stops(), (Texts{"bare", "numbered"}));
  EXPECT_EQ(confirmed_by(3), Texts{heartbeat(3000000001)});
  EXPECT_EQ(confirmed_by(4), Texts{heartbeat(77)});
}

TEST_F(ProgramOnABus, AStopOfALaterTurnIsSentSeparately) {
  stop(0, 1);
  EXPECT_EQ(stops(), (Texts{"bare", "numbered"}));
  const std::uint32_t first = number_;
  stop(1, 2);
  EXPECT_EQ(stops(), (Texts{"bare", "numbered"}));
  EXPECT_NE(number_, first);
  EXPECT_EQ(confirmed_by(4), Texts{heartbeat(2)});
  EXPECT_EQ(confirmed_by(3), Texts{heartbeat(number_)})
      << "the report names the stop of another host";
}

TEST_F(ProgramOnABus, TwoStopsOfOneBoardInOneTurnAreBothSent) {
  stop(0, 1);
  stop(0, 2);
  EXPECT_EQ(stops(), (Texts{"bare", "bare", "numbered", "numbered"}))
      << "the stops come in the order of their ids";
  EXPECT_EQ(confirmed_by(3), Texts{heartbeat(2)});
}

TEST_F(ProgramOnABus, ARepeatedStopIsOneNumberedFrameWithTheSameNumber) {
  stop(0, 1);
  EXPECT_EQ(stops(), (Texts{"bare", "numbered"}));
  const std::uint32_t first = number_;
  pass(BusStops::spacing);
  stop(0, 1);
  EXPECT_EQ(stops(), Texts{"numbered"});
  EXPECT_EQ(number_, first);
}

}  // namespace
}  // namespace r4::test
