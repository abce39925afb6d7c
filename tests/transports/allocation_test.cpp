// SPDX-License-Identifier: GPL-3.0-or-later
// A datagram needs no heap: each carrier exchanges datagrams while every `new` is counted.
#include <gtest/gtest.h>

#include "recorder.hpp"
#include "tests/bench/allocations.hpp"
#include "tests/support/datagrams.hpp"
#include "transports/memory_carrier.hpp"

namespace r4::test {
namespace {

class Player final : public Carrier::Handler {
 public:
  void on_datagram(std::string_view, Peer from) override {
    static const std::string text = captured_state();
    ++received;
    carrier->send(text, received % 2 == 0 ? Priority::state : Priority::normal, from);
  }
  void on_carrier_event(const CarrierEvent&) override {}

  Carrier* carrier = nullptr;
  int received = 0;
};

std::uint64_t allocations_of_1000_rounds(asio::io_context& io, Carrier& board, Carrier& host,
                                         Player& at_board, Player& at_host) {
  at_board.carrier = &board;
  at_host.carrier = &host;
  EXPECT_TRUE(run_until(io, [&] { return board.up() && host.up(); }));
  host.send(captured_state(), Priority::normal);
  EXPECT_TRUE(run_until(io, [&] { return at_host.received >= 100; }));
  const std::uint64_t before = bench::allocations_of_this_thread();
  EXPECT_TRUE(run_until(io, [&] { return at_host.received >= 1100; }));
  return bench::allocations_of_this_thread() - before;
}

std::uint64_t allocations_over(const std::string& board_url, const std::string& host_scheme) {
  asio::io_context io;
  Player at_board, at_host;
  const auto board = Registry::standard().make(io, board_url, Role::board);
  board->open(at_board);
  const std::string place = board->name().substr(board->name().find(':') + 1);
  const auto host = Registry::standard().make(
      io, host_scheme + place + (host_scheme == "udp:" ? "?listen=0" : ""), Role::host);
  host->open(at_host);
  return allocations_of_1000_rounds(io, *board, *host, at_board, at_host);
}

TEST(Allocations, AreNoneForADatagramOverUdp) {
  EXPECT_EQ(allocations_over("udp://127.0.0.1:0", "udp:"), 0U);
}

TEST(Allocations, AreNoneForADatagramOverPtyAndSerial) {
  EXPECT_EQ(allocations_over("pty:", "serial://"), 0U);
}

TEST(Allocations, AreNoneForADatagramInMemory) {
  asio::io_context io;
  Player at_a, at_b;
  const auto pair = make_memory_pair(io);
  pair.first->open(at_a);
  pair.second->open(at_b);
  EXPECT_EQ(allocations_of_1000_rounds(io, *pair.first, *pair.second, at_a, at_b), 0U);
}

}  // namespace
}  // namespace r4::test
