// SPDX-License-Identifier: GPL-3.0-or-later
#include "transports/udp/udp_url.hpp"

#include <gtest/gtest.h>

namespace r4::test {
namespace {

TEST(UdpUrl, OfAHostWithItsOwnPortKeepsTheOneItNames) {
  EXPECT_EQ(with_own_port("udp://robot"), "udp://robot?listen=0");
  EXPECT_EQ(with_own_port("udp:?id=left-arm"), "udp:?id=left-arm&listen=0");
  EXPECT_EQ(with_own_port("udp://robot?listen=2391"), "udp://robot?listen=2391");
  EXPECT_EQ(with_own_port("serial:auto"), "serial:auto");
}

TEST(UdpUrl, OfAHostOnAnyPortForgetsTheOneItNames) {
  EXPECT_EQ(with_any_port("udp://robot"), "udp://robot?listen=0");
  EXPECT_EQ(with_any_port("udp://robot?listen=2391"), "udp://robot?listen=0");
  EXPECT_EQ(with_any_port("udp:?listen=2391&id=listen=1"), "udp:?listen=0&id=listen=1");
  EXPECT_EQ(with_any_port("udp:?id=left-arm&listen=0"), "udp:?id=left-arm&listen=0");
  EXPECT_EQ(with_any_port("serial:auto?listen=1"), "serial:auto?listen=1");
}

}  // namespace
}  // namespace r4::test
