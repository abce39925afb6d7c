// SPDX-License-Identifier: GPL-3.0-or-later
// Described devices on the bus of a simulated board, attached through r4::AsyncBoard.
#include <gtest/gtest.h>

#include <asio/bind_cancellation_slot.hpp>
#include <asio/cancellation_signal.hpp>
#include <optional>

#include "host/devices/device_steps.hpp"
#include "r4link/async_board.hpp"
#include "r4link/devices/device.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/on_a_loop.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

// A device whose setup waits 5 s after a write.
Device slow() {
  return Device::parse("slow@0x68",
                       "device slow\ntitle a test\naddress 0x68\ncheck x75 x68\n"
                       "write x6b00 wait 5000\npoll all x3b 2 10\nvalue a all 0 i16be\n");
}

class AsyncAttach : public testing::Test, protected OnALoop {
 protected:
  explicit AsyncAttach(const BoardOptions& options = at_will()) : board_(io, "sim:", options) {
    board_.open();
  }
  CommandResult attach(const Device& device) {
    return result_of([&](auto end) { board_.async_attach(device, 5s, end); });
  }
  std::uint64_t commands() const { return board_.statistics().commands; }

  AsyncBoard board_;
};

TEST_F(AsyncAttach, PollsTheDeviceAndAddsItsFieldsToTheSelectedOnes) {
  const Device imu = Device::from("mpu6050@0x68:3");
  const CommandResult result = attach(imu);
  EXPECT_EQ(result.outcome, Outcome::confirmed);
  EXPECT_EQ(result.step, 0);
  ASSERT_TRUE(run_until([&] { return imu.reading(board_.state(), "accel_z").number.has_value(); }));
  EXPECT_NEAR(imu.reading(board_.state(), "accel_z").number.value(), 9.80665, 1e-9);
  EXPECT_TRUE(board_.state().present.has(StateField::ain24)) << "earlier fields must stay selected";
  const std::uint64_t before = commands();
  EXPECT_EQ(attach(Device::from("ina219@0x40:5")).outcome, Outcome::confirmed);
  EXPECT_EQ(commands() - before, 4U) << "one check, two readings and the choice of fields";
  EXPECT_EQ(attach(Device::from("ina219@0x40:5")).outcome, Outcome::confirmed);
  EXPECT_EQ(commands() - before, 7U) << "the fields are selected already";
}

TEST_F(AsyncAttach, RefusesASlotOfAnotherDeviceUntilThatIsDetached) {
  const auto problem_with = [&](const char* device) {
    return problem_of([&] {
      board_.async_attach(Device::from(device), 5s,
                          [](const CommandResult&) { ADD_FAILURE() << "attach must not begin"; });
    });
  };
  EXPECT_EQ(attach(Device::from("ina219@0x40")).outcome, Outcome::confirmed);
  const std::uint64_t before = commands();
  const Problem problem = problem_with("ina219@0x41");
  EXPECT_EQ(problem.kind, ErrorKind::usage);
  EXPECT_EQ(problem.text(),
            "ina219@0x41:1: ina219@0x40 has slot 1; use a free slot, ina219@0x41:3, or release "
            "that device first: X:OFF,1 X:OFF,2");
  EXPECT_EQ(problem_with("mpu6050@0x68:2").reason, "ina219@0x40 has slot 2");
  EXPECT_EQ(commands(), before) << "a refused attach must not send";

  EXPECT_EQ(attach(Device::from("ina219@0x40")).outcome, Outcome::confirmed)
      << "the same device may be attached again";
  EXPECT_EQ(attach(Device::from("ina219@0x40:7")).outcome, Outcome::confirmed)
      << "a device may move to another slot";
  EXPECT_EQ(attach(Device::from("mpu6050@0x68:2")).outcome, Outcome::confirmed)
      << "the earlier slot is free";
  result_of([&](auto off) { board_.async_send(Command::i2c_poll_off(2), 5s, off); });
  EXPECT_EQ(attach(Device::from("ina219@0x40:1")).outcome, Outcome::confirmed);
}

TEST_F(AsyncAttach, ReservesItsSlotsAtTheBeginningOfTheSetUp) {
  board_.async_attach(slow(), 5s, [](const CommandResult&) {});
  EXPECT_EQ(problem_of([&] {
              board_.async_attach(Device::from("ina219"), 5s, [](const CommandResult&) {});
            }).reason,
            "slow@0x68 has slot 1");
}

TEST(DeviceSteps, KeepTheSelectedFields) {
  const Device power = Device::from("ina219@0x40:3");
  EXPECT_EQ(fields_with("", power), "");
  EXPECT_EQ(fields_with("DEFAULT,I2C3", power), "DEFAULT,I2C3,I2C4");
  EXPECT_EQ(fields_with("I2C4,I2C3,AIN24", power), "");
}

TEST_F(AsyncAttach, RefusesAnotherDeviceAndWritesNothingToIt) {
  const Device wrong = Device::from("icm20948@0x68");
  const CommandResult result = attach(wrong);
  EXPECT_EQ(result.outcome, Outcome::refused);
  EXPECT_EQ(result.step, 1);
  EXPECT_EQ(commands(), 1U);
  const Problem problem = explain(wrong, result, board_.link());
  EXPECT_EQ(problem.kind, ErrorKind::refused);
  EXPECT_EQ(problem.outcome, Outcome::refused);
  EXPECT_EQ(problem.thing, "icm20948@0x68");
  EXPECT_EQ(problem.reason, "this is another device: its register x00 has x00, not xea");
  EXPECT_FALSE(problem.fix.empty());
}

TEST_F(AsyncAttach, RefusesADeviceThatDoesNotAnswer) {
  const Device missing = Device::from("ina219@0x41");
  const CommandResult result = attach(missing);
  EXPECT_EQ(result.outcome, Outcome::refused);
  EXPECT_EQ(result.transfer.outcome, I2cOutcome::no_acknowledge);
  EXPECT_EQ(explain(missing, result, board_.link()).reason,
            "the device does not answer: no acknowledge");
}

TEST_F(AsyncAttach, CanBeCancelledWhileItWaitsForTheDevice) {
  asio::cancellation_signal signal;
  std::optional<std::uint32_t> first;  // packet number of the device check
  const ScopedSubscription states =
      board_.on_state([&](const ReceivedState& state, const Datagram&) {
        const std::uint32_t answered = state.i2c_answer.pnum;
        if (answered == 0) return;
        if (!first) first = answered;
        if (answered != *first) signal.emit(asio::cancellation_type::terminal);
      });
  const CommandResult result = result_of([&](auto end) {
    board_.async_attach(slow(), 5s, asio::bind_cancellation_slot(signal.slot(), end));
  });
  EXPECT_EQ(result.outcome, Outcome::cancelled);
  EXPECT_EQ(result.step, 2);
  EXPECT_EQ(commands(), 2U);
}

TEST_F(AsyncAttach, EndsWithTheBoard) {
  std::optional<CommandResult> result;
  board_.async_attach(slow(), 5s, [&](const CommandResult& r) { result = r; });
  ASSERT_TRUE(run_until([&] { return board_.state().i2c_answer.pnum != 0; }));
  board_.close();
  ASSERT_TRUE(run_until([&] { return result.has_value(); }));
  EXPECT_EQ(result->outcome, Outcome::closed);
}

TEST_F(AsyncAttach, RefusesAZeroTimeoutAndAWatcherAtOnce) {
  const auto ignored = [](const CommandResult&) { ADD_FAILURE() << "attach must not begin"; };
  EXPECT_EQ(problem_of([&] { board_.async_attach(slow(), 0s, ignored); }).kind, ErrorKind::usage);
  BoardOptions options;
  options.role = BoardRole::watch;
  AsyncBoard watcher(io, "sim:", options);
  EXPECT_EQ(problem_of([&] { watcher.async_attach(slow(), 1s, ignored); }).kind, ErrorKind::usage);
}

TEST_F(AsyncAttach, NamesTheDeviceWhenTheBoardIsSilent) {
  AsyncBoard board(io, "udp://127.0.0.1:9?listen=0", at_will());
  board.open();
  const Device device = Device::from("ina219");
  const CommandResult result = result_of([&](auto end) { board.async_attach(device, 50ms, end); });
  EXPECT_EQ(result.outcome, Outcome::timed_out);
  const Problem problem = explain(device, result, board.link());
  EXPECT_EQ(problem.thing, "ina219@0x40: X:READ,64,x01,2");
  EXPECT_TRUE(contains(problem.reason, "nothing was received from the board yet"));
}

struct AsyncAttachUnarmed : AsyncAttach {
  AsyncAttachUnarmed() : AsyncAttach(BoardOptions{}) {}
};

TEST_F(AsyncAttachUnarmed, WritesOnlyAfterArm) {
  const Device imu = Device::from("mpu6050");
  const CommandResult result = attach(imu);
  EXPECT_EQ(result.outcome, Outcome::not_armed);
  EXPECT_EQ(result.step, 2);
  EXPECT_TRUE(explain(imu, result, board_.link()).thing.starts_with("mpu6050@0x68: X:WRITE,104,"));
  EXPECT_EQ(attach(Device::from("ina219@0x40:3")).outcome, Outcome::confirmed)
      << "nothing may be written to the device";
  result_of([&](auto armed) { board_.async_arm(5s, armed); });
  EXPECT_EQ(attach(imu).outcome, Outcome::confirmed);
}

TEST_F(AsyncAttach, IsCancelledWhenControlIsReleasedDuringADeviceDelay) {
  std::optional<CommandResult> attached, released;
  result_of([&](auto active) { board_.async_wait_active(5s, active); });
  const std::uint64_t before = commands();
  board_.async_attach(slow(), 20s, [&](const CommandResult& r) { attached = r; });
  ASSERT_TRUE(run_until([&] { return commands() >= before + 2; }));  // the check, then the write
  ASSERT_TRUE(run_until([&, end = std::chrono::steady_clock::now() + 100ms] {
    return std::chrono::steady_clock::now() > end;
  }));
  ASSERT_FALSE(attached);
  board_.async_release_control(2s, [&](const CommandResult& r) { released = r; });
  ASSERT_TRUE(run_until([&] { return attached && released; }));
  EXPECT_EQ(attached->outcome, Outcome::cancelled);
  EXPECT_EQ(released->outcome, Outcome::confirmed);
}

}  // namespace
}  // namespace r4::test
