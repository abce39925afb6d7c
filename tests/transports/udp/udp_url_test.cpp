// SPDX-License-Identifier: GPL-3.0-or-later
#include "transports/udp/udp_url.hpp"

#include <gtest/gtest.h>

#include "r4link/error.hpp"

namespace r4::test {
namespace {

TEST(UdpUrl, WithOwnPortKeepsANamedPort) {
  EXPECT_EQ(with_own_port("udp://robot"), "udp://robot?listen=0");
  EXPECT_EQ(with_own_port("udp:?id=left-arm"), "udp:?id=left-arm&listen=0");
  EXPECT_EQ(with_own_port("udp://robot?listen=2391"), "udp://robot?listen=2391");
  EXPECT_EQ(with_own_port("serial:auto"), "serial:auto");
}

TEST(UdpUrl, WithAnyPortReplacesANamedPort) {
  EXPECT_EQ(with_any_port("udp://robot"), "udp://robot?listen=0");
  EXPECT_EQ(with_any_port("udp://robot?listen=2391"), "udp://robot?listen=0");
  EXPECT_EQ(with_any_port("udp:?listen=2391&id=listen=1"), "udp:?listen=0&id=listen=1");
  EXPECT_EQ(with_any_port("udp:?id=left-arm&listen=0"), "udp:?id=left-arm&listen=0");
  EXPECT_EQ(with_any_port("serial:auto?listen=1"), "serial:auto?listen=1");
}

TEST(UdpUrl, AcceptsOnlyValidBoardNames) {
  EXPECT_EQ(UdpUrl(Url::parse("udp:?id=left-arm"), Role::host).called, "left-arm");
  for (const std::string& id : {std::string(), std::string("a%20b"), std::string("%3D1"),
                                std::string("%1B[2J"), std::string(65, 'n')}) {
    EXPECT_THROW(UdpUrl(Url::parse("udp:?id=" + id), Role::host), Error) << id;
  }
}

TEST(UdpUrl, MayNameAnAddressOfThisComputer) {
  const auto local = [](const char* url) {
    return UdpUrl(Url::parse(url), Role::host).local.to_string();
  };
  EXPECT_EQ(local("udp://robot?local=10.0.0.7"), "10.0.0.7");
  EXPECT_EQ(local("udp://robot?listen=0&local=fd00::7"), "fd00::7");
  EXPECT_EQ(local("udp://robot"), "0.0.0.0");
  for (const char* url :
       {"udp://robot?local=", "udp://robot?local=eth0", "udp://robot?local=0.0.0.0",
        "udp://robot?local=239.1.1.1", "udp:auto?local=10.0.0.7"}) {
    EXPECT_THROW(local(url), Error) << url;
  }
}

}  // namespace
}  // namespace r4::test
