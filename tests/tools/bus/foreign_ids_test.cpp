// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/r4/bus/foreign_ids.hpp"

#include <gtest/gtest.h>

namespace r4::tool {
namespace {

TEST(ForeignIds, AreNamedAsCanopenAndOdriveNameThem) {
  EXPECT_EQ(foreign_names(0x000), "CANopen NMT, or ODrive axis 0");
  EXPECT_EQ(foreign_names(0x080), "CANopen SYNC, or ODrive axis 4");
  EXPECT_EQ(foreign_names(0x081), "CANopen EMCY of node 1, or ODrive axis 4 heartbeat");
  EXPECT_EQ(foreign_names(0x123), "ODrive axis 9");
  EXPECT_EQ(foreign_names(0x185), "CANopen TPDO1 of node 5, or ODrive axis 12");
  EXPECT_EQ(foreign_names(0x1FF), "CANopen TPDO1 of node 127, or ODrive axis 15");
  EXPECT_EQ(foreign_names(0x209), "CANopen RPDO1 of node 9, or ODrive axis 16 encoder");
  EXPECT_EQ(foreign_names(0x601), "CANopen SDO request of node 1, or ODrive axis 48 heartbeat");
  EXPECT_EQ(foreign_names(0x705), "CANopen heartbeat of node 5, or ODrive axis 56");
  EXPECT_EQ(foreign_names(0x780), "ODrive axis 60");
}

}  // namespace
}  // namespace r4::tool
