// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/discovery/transports.hpp"

#include <gtest/gtest.h>

#include <asio/io_context.hpp>
#include <memory>
#include <string>

#include "r4link/discovery/async_carriers.hpp"

namespace r4 {
namespace {

TEST(Transports, AreListedWithTheirHelp) {
  std::string schemes;
  for (const TransportHelp& each : transports()) {
    schemes += each.scheme + " ";
    EXPECT_TRUE(each.usage.starts_with(each.scheme + ":")) << each.usage;
    EXPECT_FALSE(each.meaning.empty()) << each.scheme;
  }
  EXPECT_EQ(schemes, "udp serial pty can sim replay ");
}

TEST(Transports, AnOwnUdpCarrierDoesNotUseTheHostPort) {
  asio::io_context io;
  EXPECT_EQ(make_own_carrier(io, "udp://127.0.0.1?listen=2390")->name(),
            "udp://127.0.0.1?listen=0");
}

}  // namespace
}  // namespace r4
