// SPDX-License-Identifier: GPL-3.0-or-later
#include "transports/registry.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "recorder.hpp"
#include "tests/support/problems.hpp"
#include "transports/memory_carrier.hpp"

namespace r4::test {
namespace {

TEST(Registry, MakesACarrierForEachTransport) {
  asio::io_context io;
  const Registry registry = Registry::standard();
  EXPECT_NE(registry.make(io, "udp://127.0.0.1", Role::host), nullptr);
  EXPECT_NE(registry.make(io, "udp:auto", Role::host), nullptr);
  EXPECT_NE(registry.make(io, "udp:?id=left&port=2019&listen=0", Role::host), nullptr);
  EXPECT_NE(registry.make(io, "serial:auto", Role::host), nullptr);
  EXPECT_NE(registry.make(io, "pty:", Role::board), nullptr);
  const auto on_can = registry.make(io, "can://can0?node=31&fd=1&pack=1", Role::host);
  EXPECT_EQ(on_can->name(), "can://can0?node=31&fd=1") << "the packed form is the default";
  EXPECT_EQ(registry.make(io, "can://can0?pack=0", Role::host)->name(), "can://can0?node=1&pack=0");
  EXPECT_NE(registry.make(io, "can://can0?node=0", Role::board), nullptr);
  EXPECT_EQ(registry.entries().size(), 4U);
}

TEST(Registry, NamesTheTransportsThatItHas) {
  asio::io_context io;
  const Problem problem =
      problem_of([&] { Registry::standard().make(io, "tcp://127.0.0.1", Role::host); });
  EXPECT_EQ(problem.kind, ErrorKind::usage);
  EXPECT_EQ(problem.thing, "tcp://127.0.0.1");
  EXPECT_EQ(problem.reason, "there is no transport 'tcp'");
  for (const char* usage : {"udp://HOST", "serial:auto", "pty:[PATH]"}) {
    EXPECT_TRUE(contains(problem.fix, usage));
  }
}

TEST(Registry, TakesFurtherTransports) {
  asio::io_context io;
  Registry registry = Registry::standard();
  registry.add({{"memory", "memory:", "for this test"},
                [](asio::io_context& loop, const Url&, Role, const Claim&) {
                  return make_memory_pair(loop).first;
                }});
  EXPECT_EQ(registry.make(io, "memory:", Role::host)->name(), "memory:");
}

TEST(Registry, AnUnsharedHostCarrierIgnoresTheGroupOfItsUrl) {
  asio::io_context io;
  const Registry registry = Registry::standard();
  for (const char* url :
       {"udp://127.0.0.1?listen=0&share=nobodys", "can://can0?node=2&share=lab"}) {
    EXPECT_NE(registry.make(io, url, Role::host), nullptr) << url;
  }
  EXPECT_TRUE(error_of([&] { registry.make(io, "udp://:2018?share=lab", Role::board); }))
      << "a board does not share its transport";
}

TEST(Registry, SharesAPathOnlyWithAnExistingGroup) {
  asio::io_context io;
  const Registry registry = Registry::standard();
  EXPECT_NE(registry.make_shared(io, "can://can0?node=2&share=root", BoardRole::watch), nullptr);
  const Problem problem = problem_of(
      [&] { registry.make_shared(io, "serial:auto?share=nobodys", BoardRole::control); });
  EXPECT_EQ(problem.kind, ErrorKind::usage);
  EXPECT_EQ(problem.reason, "there is no group 'nobodys' on this machine");
  EXPECT_EQ(run_unprivileged([&] {
              const auto refused = error_of([&] {
                registry.make_shared(io, "udp://127.0.0.1?share=daemon", BoardRole::control);
              });
              return refused && refused->kind() == ErrorKind::permission ? 0 : 1;
            }),
            0);
}

struct Refusal {
  std::string url;
  Role role;
  std::string reason;
};

TEST(Registry, RefusesAnInvalidUrlOfATransport) {
  const std::vector<Refusal> table = {
      {"udp:", Role::host, "the URL is not udp://HOST"},
      {"udp:192.168.1.77", Role::host, "the URL is not udp://HOST"},
      {"udp:auto", Role::board, "the URL is not udp://HOST"},
      {"udp:?id=left", Role::board, "the URL is not udp://HOST"},
      {"udp:auto?id=left", Role::host, "does not name one board"},
      {"udp:left?id=left", Role::host, "does not name one board"},
      {"udp:?id=", Role::host, "does not name one board"},
      {"udp:?id=" + std::string(300, 'n'), Role::host, "does not name one board"},
      {"udp:?id=left&peer=x", Role::host, "no option 'peer'"},
      {"udp:auto?port=0", Role::host, "out of range"},
      {"udp:auto?listen=any", Role::host, "not a whole number"},
      {"udp://host?id=left", Role::host, "no option 'id'"},
      {"udp://host?port=2018", Role::host, "no option 'port'"},
      {"udp://host/path", Role::host, "the URL is not udp://HOST"},
      {"udp://host:0", Role::host, "0 is not a valid port"},
      {"udp://host?listen=65536", Role::host, "out of range"},
      {"udp://host?listen=any", Role::host, "not a whole number"},
      {"udp://host?peer=x", Role::host, "no option 'peer'"},
      {"udp://0.0.0.0?listen=1", Role::board, "no option 'listen'"},
      {"udp://0.0.0.0?peer=", Role::board, "is not HOST"},
      {"udp://0.0.0.0?peer=host:0", Role::board, "is not HOST"},
      {"udp://0.0.0.0?peer=host/x", Role::board, "is not HOST"},
      {"serial:", Role::host, "does not name a serial port"},
      {"serial:ttyACM0", Role::host, "does not name a serial port"},
      {"serial://ttyACM0", Role::host, "does not name a serial port"},
      {"serial:auto?sn=5", Role::host, "does not name a serial port"},
      {"serial:///dev/ttyACM0?sn=5", Role::host, "does not name a serial port"},
      {"serial:?sn=", Role::host, "does not name a serial port"},
      {"serial:auto?baud=1200", Role::host, "out of range"},
      {"serial:auto?baud=fast", Role::host, "not a whole number"},
      {"serial:auto?speed=9600", Role::host, "no option 'speed'"},
      {"pty:/tmp/r4", Role::host, "the board's end"},
      {"pty://tmp/r4", Role::board, "the URL is not pty:"},
      {"pty:/tmp/r4?baud=9600", Role::board, "no option 'baud'"},
  };
  asio::io_context io;
  for (const Refusal& row : table) {
    SCOPED_TRACE(row.url);
    const Problem problem = problem_of([&] { Registry::standard().make(io, row.url, row.role); });
    EXPECT_EQ(problem.kind, ErrorKind::usage);
    EXPECT_TRUE(contains(problem.reason, row.reason));
    EXPECT_FALSE(problem.fix.empty());
  }
}

}  // namespace
}  // namespace r4::test
