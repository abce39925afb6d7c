// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <memory>

#include "shared_wire.hpp"
#include "transports/share/share_socket.hpp"

namespace r4::test {
namespace {

class PlaceOfADevice : public SharedWireTest {};

// As the board behind a link to a pty is, when it ends and begins again.
TEST_F(PlaceOfADevice, IsLeftToAnotherWhenItGoesAndIsWhereItComesAgain) {
  SharedWire now{wire, group, true};
  const auto made = [&] {
    auto one = std::make_unique<Program>();
    auto claim = std::make_shared<DeviceClaim>();
    one->carrier = make_shared_carrier(
        io, std::make_unique<Device::Wire>(io, device, claim), claim, [&] { return now; },
        BoardRole::watch);
    one->carrier->open(one->heard);
    return one;
  };
  const auto holder = made();
  const auto early = made();
  ASSERT_TRUE(run_until(io, [&] { return early->carrier->up(); }));
  EXPECT_FALSE(hold_wire(at_place({wire, group}, 0)));

  now.name = wire + "/link";  // which ends nowhere now
  device.report({CarrierEvent::Kind::down,
                 Problem{ErrorKind::open, "device:", "unplugged", "plug it in again"}});
  ASSERT_TRUE(run_until(io, [&] { return early->heard.count(Kind::down) == 1; }));
  EXPECT_TRUE(hold_wire(at_place({wire, group}, 0))) << "nobody's, until another holds it";
  const auto meanwhile = made();
  ASSERT_TRUE(run_until(io, [&] { return meanwhile->heard.count(Kind::down) == 1; }));

  now.name = wire + "/elsewhere";
  device.report({CarrierEvent::Kind::up, Problem{ErrorKind::open, "device:", "", ""}});
  ASSERT_TRUE(run_until(io, [&] { return early->carrier->up() && meanwhile->carrier->up(); }));
  const auto late = made();
  ASSERT_TRUE(run_until(io, [&] { return late->carrier->up(); }));
  EXPECT_EQ(device.opened, 1);
  device.deliver("to all");
  for (const auto* each : {&holder, &early, &meanwhile, &late}) {
    EXPECT_TRUE(in_time([&] { return (*each)->has("to all"); }));
  }
}

TEST_F(PlaceOfADevice, IsKeptWhereItIsANameOfItsOwn) {
  const auto holder = opened(BoardRole::watch);
  device.report({CarrierEvent::Kind::down,
                 Problem{ErrorKind::open, "device:", "unplugged", "plug it in again"}});
  ASSERT_TRUE(run_until(io, [&] { return holder->heard.count(Kind::down) == 1; }));
  EXPECT_FALSE(hold_wire(at_place({wire, group}, 0)));
}

}  // namespace
}  // namespace r4::test
