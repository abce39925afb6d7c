// SPDX-License-Identifier: GPL-3.0-or-later
// A CanBus on a separate vxcan pair. The CanBus treats frames from the far end as frames of another
// machine, and frames sent at the near end as local. For tools/with-can.
#pragma once

#include <gtest/gtest.h>
#include <linux/can/error.h>

#include <asio/io_context.hpp>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "r4link/discovery/url.hpp"
#include "tests/transports/can/kernel/raw_can.hpp"
#include "tests/transports/recorder.hpp"
#include "transports/can/can_bus.hpp"
#include "transports/can/can_carrier.hpp"

namespace r4::test {

inline constexpr char near_end[] = "vxcan7";
inline constexpr char far_end[] = "vxcan8";
inline constexpr std::uint8_t node = 3;
inline constexpr std::uint32_t heard_frame_id = 0x183;
inline constexpr std::uint32_t other_id = 0x555;
inline constexpr std::chrono::milliseconds soon{200};

// The two interfaces exist while the tests of a suite run.
class CanBusTest : public testing::Test {
 public:
  static void SetUpTestSuite() {
    remove();
    ASSERT_EQ(0, std::system("ip link add dev vxcan7 type vxcan peer name vxcan8 && "
                             "ip link set vxcan7 up && ip link set vxcan8 up"))
        << "needs root, and vxcan in the kernel: tools/with-can";
  }
  static void TearDownTestSuite() { remove(); }

 protected:
  [[nodiscard]] bool run_until(const std::function<bool()>& is_so) {
    return test::run_until(io, is_so);
  }
  void run_for(std::chrono::milliseconds time) { test::run_for(io, time); }

  static CanFrame data(std::uint8_t byte) {
    CanFrame frame{};
    frame.id = heard_frame_id;
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

  void become_passive() {
    local.send(error(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE));
    ASSERT_TRUE(run_until([&] { return bus->standing().has_value(); }));
  }
  std::unique_ptr<Carrier> host() {
    return make_can_carrier(io, Url::parse("can://vxcan7?node=3"), Role::host);
  }

  asio::io_context io{1};
  RawCan local{other_id, near_end};
  RawCan remote{other_id, far_end};
  std::shared_ptr<CanBus> bus = CanBus::of(io, near_end, false);

 private:
  static void remove() {
    [[maybe_unused]] const int ended = std::system("ip link del vxcan7 2>/dev/null");
  }
};

// Records the calls of its bus.
class Witness final : public CanBus::Member {
 public:
  explicit Witness(std::shared_ptr<CanBus> bus, std::uint32_t id = heard_frame_id)
      : bus_(std::move(bus)) {
    bus_->join(*this, {id});
  }
  ~Witness() { leave(); }
  Witness(const Witness&) = delete;
  Witness& operator=(const Witness&) = delete;

  void leave() {
    if (bus_) bus_->leave(*this);
    bus_.reset();
  }

  std::vector<std::pair<Kind, std::string>> events;
  std::string fix;  // fix of the newest event
  std::vector<std::uint8_t> frames;
  std::vector<std::uint32_t> came_us;
  std::function<void()> in_event = [] {};
  std::function<void()> in_frame = [] {};

 private:
  void on_frame(const CanFrame& frame, std::uint32_t at_us) override {
    EXPECT_TRUE(bus_) << "called after leave()";
    frames.push_back(frame.data[0]);
    came_us.push_back(at_us);
    in_frame();
  }
  void on_bus(const CarrierEvent& event) override {
    EXPECT_TRUE(bus_) << "called after leave()";
    events.emplace_back(event.kind, event.problem.reason);
    fix = event.problem.fix;
    EXPECT_EQ(event.problem.thing, std::string("can://") + near_end);
    in_event();
  }

  std::shared_ptr<CanBus> bus_;
};

}  // namespace r4::test
