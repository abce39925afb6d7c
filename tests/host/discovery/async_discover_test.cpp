// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/discovery/async_discover.hpp"

#include <gtest/gtest.h>

#include <asio/io_context.hpp>
#include <asio/steady_timer.hpp>
#include <asio/use_future.hpp>
#include <exception>
#include <future>
#include <memory>
#include <optional>
#include <utility>

#include "tests/transports/udp/search/answering_boards.hpp"

namespace r4::test {
namespace {

DiscoveryOptions at_port_by_udp(std::uint16_t port) {
  DiscoveryOptions options;
  options.serial = options.can = false;
  options.udp_port = port;
  return options;
}

TEST(AsyncDiscover, CallsItsHandlerOnTheLoopWithTheFoundBoards) {
  AnsweringBoards boards;
  boards.add("0.1", {identity("b-1")});
  asio::io_context io;
  std::optional<Discovery> found;
  // The handler may be a type that can only be moved.
  async_discover(io.get_executor(), at_port_by_udp(boards.port()),
                 [&, only = std::make_unique<int>()](std::exception_ptr error, Discovery all) {
                   EXPECT_FALSE(error);
                   EXPECT_TRUE(io.get_executor().running_in_this_thread());
                   found = std::move(all);
                 });
  io.run();
  ASSERT_TRUE(found);
  EXPECT_EQ(found->only().identity->board_id, "b-1");
}

TEST(AsyncDiscover, ThrowsTheSameErrorsAsDiscover) {
  asio::io_context io;
  std::future<Discovery> found =
      async_discover(io.get_executor(), at_port_by_udp(0), asio::use_future);
  io.run();
  EXPECT_THROW(found.get(), Error);
}

TEST(AsyncDiscover, DestroyingTheLoopEndsTheSearchWithoutCallingTheHandler) {
  bool called = false;
  const auto held = std::make_shared<int>();
  {
    asio::io_context io;
    for (int i = 0; i < 2; ++i) {
      // The second handler waits and owns a timer. The timer must not outlive the loop.
      async_discover(io.get_executor(), at_port_by_udp(2018),
                     [&called, held, timer = asio::steady_timer(io)](std::exception_ptr,
                                                                     Discovery) { called = true; });
    }
  }
  EXPECT_FALSE(called);
  EXPECT_EQ(held.use_count(), 1);
}

}  // namespace
}  // namespace r4::test
