// SPDX-License-Identifier: GPL-3.0-or-later
// Who shares a wire with a holder that hangs.
#include <gtest/gtest.h>

#include <array>
#include <cstddef>

#include "shared_wire.hpp"
#include "transports/share/share_socket.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

class HangingHolder : public SharedWireTest {};

TEST_F(HangingHolder, AHolderThatDoesNotAnswerIsNamed) {
  asio::io_context stopped;  // nobody runs it
  const auto holder = program(BoardRole::watch, stopped);
  holder->carrier->open(holder->heard);
  const std::string who = "this program has it open already";

  const auto driver = program(BoardRole::control, io);
  const auto error = error_of([&] { driver->carrier->open(driver->heard); });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->problem().reason, who);

  const auto watcher = program(BoardRole::watch, io);
  const auto began = Clock::now();
  watcher->carrier->open(watcher->heard);
  EXPECT_LT(in_milliseconds(Clock::now() - began), 100) << "it blocks the loop";
  ASSERT_TRUE(run_until(io, [&] { return watcher->heard.count(Kind::down) == 1; }));
  EXPECT_EQ(watcher->heard.last(Kind::down)->problem.reason, who);
  const auto goes_on = [&] {
    return in_time([&] {
      run_for(stopped, 5ms);
      return watcher->carrier->up();
    });
  };
  ASSERT_TRUE(goes_on());
  EXPECT_EQ(watcher->heard.count(Kind::down), 1U);
  // Again, when the watcher has long shared with it.
  ASSERT_TRUE(run_until(io, [&] { return watcher->heard.count(Kind::down) == 2; }));
  EXPECT_EQ(watcher->heard.last(Kind::down)->problem.reason, who);
  ASSERT_TRUE(goes_on());
  EXPECT_EQ(watcher->heard.count(Kind::down), 2U);
  EXPECT_EQ(device.opened, 1);
}

TEST_F(HangingHolder, ThoseWhomAHolderThatHangsIsNoHelpToMeetBesideIt) {
  device.exclusive = false;
  asio::io_context hanging;
  const auto holder = program(BoardRole::watch, hanging);
  holder->carrier->open(holder->heard);
  OtherThread elsewhere;
  std::array<std::unique_ptr<Program>, 3> watchers;
  elsewhere.run([&] {
    for (auto& each : watchers) {
      each = program(BoardRole::watch, elsewhere.loop);
      each->carrier->open(each->heard);
    }
  });
  const auto each_hears = [&](const std::string& text) {
    return in_time([&] {
      device.deliver(text);
      run_for(io, 5ms);
      bool all = true;
      elsewhere.run([&] {
        for (const auto& each : watchers) all = all && each->has(text);
      });
      return all;
    });
  };
  // A board that says nothing is no holder that hangs.
  run_for(hanging, 1500ms);
  EXPECT_EQ(device.opened, 1);
  elsewhere.run([&] {
    for (const auto& each : watchers) EXPECT_EQ(each->heard.count(Kind::up), 1U);
  });

  const auto hangs_since = Clock::now();
  EXPECT_TRUE(each_hears("beside it"));
  EXPECT_LT(in_milliseconds(Clock::now() - hangs_since), 2000);
  EXPECT_EQ(device.opened, 2) << "one for all of them";
  // So does who comes to control.
  const auto driver = program(BoardRole::control, io);
  driver->carrier->open(driver->heard);
  EXPECT_TRUE(driver->carrier->up());
  EXPECT_TRUE(each_hears("driven"));
  elsewhere.run([&] {
    EXPECT_EQ(watchers[0]->heard.count(Kind::down), 0U);
    for (auto& each : watchers) each.reset();
  });
}

TEST_F(HangingHolder, AHolderThatHangsAndOnlyWatchesLosesTheWireAndComesBackAsOneThatShares) {
  device.may_be_taken = true;
  asio::io_context hanging;
  const auto holder = program(BoardRole::watch, hanging);
  holder->carrier->open(holder->heard);
  const auto watcher = program(BoardRole::watch, io);
  watcher->carrier->open(watcher->heard);
  const auto hear = [&](const std::string& text, const auto&... programs) {
    return in_time([&] {
      device.deliver(text);
      run_for(io, 5ms);
      return (programs->has(text) && ...);
    });
  };
  EXPECT_TRUE(hear("without it", watcher));
  EXPECT_EQ(device.opened, 2);
  OtherThread elsewhere;
  std::unique_ptr<Program> driver;
  const auto drive = [&] {
    driver = program(BoardRole::control, elsewhere.loop);
    driver->carrier->open(driver->heard);
  };
  // This thread answers meanwhile: the watcher gives way.
  std::atomic<bool> driving = false;
  asio::post(elsewhere.loop, [&] {
    drive();
    driving = true;
  });
  ASSERT_TRUE(in_time([&] { return driving.load(); }));
  EXPECT_TRUE(hear("driven", watcher));
  EXPECT_FALSE(holder->has("without it"));
  const auto driven_at = device.opened;
  // It goes on.
  ASSERT_TRUE(in_time([&] {
    run_for(hanging, 5ms);
    device.deliver("joined");
    return holder->has("joined");
  }));
  EXPECT_TRUE(holder->carrier->is_shared());
  EXPECT_EQ(device.opened, driven_at);
  EXPECT_EQ(watcher->heard.count(Kind::down), 0U);
  EXPECT_EQ(holder->heard.count(Kind::down), 0U);
  // The driver is not to be had.
  const auto second = program(BoardRole::control, io);
  const auto refused = error_of([&] { second->carrier->open(second->heard); });
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->kind(), ErrorKind::refused);
  elsewhere.run([&] { driver.reset(); });
}

TEST_F(HangingHolder, AHolderThatHangsAndControlsKeepsTheWire) {
  device.may_be_taken = true;
  asio::io_context hanging;
  const auto holder = program(BoardRole::control, hanging);
  holder->carrier->open(holder->heard);
  for (const BoardRole role : {BoardRole::control, BoardRole::watch}) {
    const auto other = program(role, io);
    const auto error = error_of([&] { other->carrier->open(other->heard); });
    EXPECT_EQ(error.has_value(), role == BoardRole::control);
    EXPECT_TRUE(error || run_until(io, [&] { return other->heard.count(Kind::down) == 1; }));
  }
  EXPECT_EQ(device.opened, 1);
}

TEST_F(HangingHolder, HoldersThatHangHaveFourPlacesWhichAreUsedAgain) {
  device.exclusive = false;
  std::array<asio::io_context, share_places + 1> loops;  // that go on no more when theirs is up
  std::vector<std::unique_ptr<Program>> hanging;
  const auto hangs_in = [&](asio::io_context& loop) {
    auto made = program(BoardRole::watch, loop);
    made->carrier->open(made->heard);
    EXPECT_TRUE(run_until(loop, [&] { return made->carrier->up(); }));
    return made;
  };
  for (int place = 0; place < share_places; ++place) {
    hanging.push_back(hangs_in(loops[static_cast<std::size_t>(place)]));
    EXPECT_TRUE(reach_holder(at_place({wire}, place)).connection) << place;
  }
  hanging[0]->carrier->close();
  hanging.push_back(hangs_in(loops.back()));
  EXPECT_TRUE(reach_holder({wire}).connection);
  const auto alone = opened(BoardRole::watch);
  EXPECT_FALSE(alone->carrier->is_shared());
  EXPECT_EQ(device.opened, share_places + 2);
  EXPECT_FALSE(reach_holder(at_place({wire}, share_places)).connection);
}

// Those that came while it hung, and have gone, still wait in its queue.
TEST_F(HangingHolder, AHolderWhoseQueueIsFullIsPassedOver) {
  device.exclusive = false;
  asio::io_context loop;
  auto hanging = program(BoardRole::watch, loop);
  hanging->carrier->open(hanging->heard);
  ASSERT_TRUE(run_until(loop, [&] { return hanging->carrier->up(); }));
  int came = 0;
  while (reach_holder({wire}).connection && came < 1000) ++came;
  EXPECT_TRUE(reach_holder({wire}).hangs);
  for (const BoardRole role : {BoardRole::watch, BoardRole::control}) {
    const auto late = opened(role);
    EXPECT_TRUE(in_time([&] { return late->carrier->up(); }));
    late->carrier->close();
  }
}

}  // namespace
}  // namespace r4::test
