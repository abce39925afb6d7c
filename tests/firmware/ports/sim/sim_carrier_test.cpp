// SPDX-License-Identifier: GPL-3.0-or-later
#include "firmware/ports/sim/sim_carrier.hpp"

#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

#include "r4link/config.hpp"
#include "tests/support/datagrams.hpp"

namespace r4::sim {
namespace {

struct Listener final : Carrier::Handler {
  std::vector<std::string> heard;
  bool up = false;
  void on_datagram(std::string_view bytes, Peer) override { heard.emplace_back(bytes); }
  void on_carrier_event(const CarrierEvent& event) override {
    up = event.kind == CarrierEvent::Kind::up;
  }
};

// The board's answer to Q:ID through a carrier with this URL.
std::string identity_of(const std::string& url) {
  asio::io_context io;
  const auto carrier = make_sim_carrier(io, Url::parse(url));
  Listener listener;
  carrier->open(listener);
  EXPECT_TRUE(carrier->up());
  EXPECT_TRUE(listener.up);
  EXPECT_EQ(carrier->name(), url);
  carrier->send(test::with_crc("Q:ID;PNum:1;T:1;"), Priority::normal, everyone);
  io.poll();
  carrier->close();
  carrier->close();
  EXPECT_FALSE(carrier->up());
  for (const std::string& line : listener.heard) {
    if (line[0] == 'I') return line.substr(0, line.find(';'));
  }
  return "";
}

std::string url_error(const std::string& url) {
  asio::io_context io;
  try {
    make_sim_carrier(io, Url::parse(url));
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(SimCarrier, ConnectsToASimulatedBoard) {
  EXPECT_EQ(identity_of("sim:"),
            "I:R4," R4LINK_VERSION ",sim-1,sim+leave+group+watch+i2c+uart+dac");
  EXPECT_EQ(identity_of("sim:?node=31&seed=4"),
            "I:R4," R4LINK_VERSION ",sim-31,sim+leave+group+watch+i2c+uart+dac");
}

TEST(SimCarrier, RefusesAnInvalidUrl) {
  for (const char* url :
       {"sim:?node=32", "sim:?node=-1", "sim:?node=x", "sim:?seed=x", "sim:?colour=red",
        "sim:/dev/ttyACM0", "sim://host", "sim:?script=/nonexistent/script.txt"}) {
    EXPECT_NE(url_error(url), "") << url;
  }
}

TEST(SimCarrier, PlaysAScript) {
  const std::string path = testing::TempDir() + "r4_sim_carrier_test.txt";
  std::ofstream(path) << "0 handle released\n";
  asio::io_context io;
  const auto carrier = make_sim_carrier(io, Url::parse("sim:?script=" + path));
  Listener listener;
  carrier->open(listener);
  carrier->send(test::with_crc("E:STOP;PNum:1;T:1;"), Priority::stop, everyone);
  io.poll();
  std::remove(path.c_str());
  ASSERT_FALSE(listener.heard.empty());
  EXPECT_NE(listener.heard.back().find(";SAFE:2;"), std::string::npos) << listener.heard.back();
}

TEST(SimCarrier, MayBeDestroyedWhileOpen) {
  asio::io_context io;
  Listener listener;
  {
    const auto carrier = make_sim_carrier(io, Url::parse("sim:"));
    carrier->open(listener);
    carrier->send(test::with_crc("Q:ID;PNum:1;T:1;"), Priority::normal, everyone);
  }
  io.poll();
  EXPECT_EQ(listener.heard.size(), 0U);
}

}  // namespace
}  // namespace r4::sim
