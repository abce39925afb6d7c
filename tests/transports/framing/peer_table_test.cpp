// SPDX-License-Identifier: GPL-3.0-or-later
#include "transports/framing/peer_table.hpp"

#include <gtest/gtest.h>

#include <set>
#include <string>

#include "tests/support/datagrams.hpp"

namespace r4::test {
namespace {

using Peers = PeerTable<int, 16>;
constexpr int owner = -1;

TEST(PeerTable, NumbersEverySenderOnce) {
  Peers peers;
  std::set<std::uint32_t> numbers;
  for (int i = 0; i < Peers::capacity; ++i) numbers.insert(peers.heard(i));
  EXPECT_EQ(numbers.size(), static_cast<std::size_t>(Peers::capacity));
  EXPECT_EQ(numbers.count(Peers::nobody), 0U);
  const std::uint32_t first = peers.heard(0);
  EXPECT_EQ(numbers.count(first), 1U) << "a known peer keeps its number";
  EXPECT_EQ(peers.audience(), first);
  EXPECT_EQ(*peers.find(first), 0);
}

TEST(PeerTable, ReplacesThePeerSilentLongestAndNeverReusesANumber) {
  Peers peers;
  std::set<std::uint32_t> numbers;
  for (int i = 0; i < Peers::capacity; ++i) numbers.insert(peers.heard(i));
  peers.heard(0);
  const std::uint32_t silent = peers.heard(1) + 1;  // the number of peer 2
  EXPECT_EQ(*peers.find(silent), 2);
  numbers.insert(peers.heard(100));
  EXPECT_EQ(peers.find(silent), nullptr);
  numbers.insert(peers.heard(2));
  EXPECT_EQ(numbers.size(), static_cast<std::size_t>(Peers::capacity + 2));
}

TEST(PeerTable, AddsNoPeerForAnInvalidDatagram) {
  Peers peers;
  const std::uint32_t host = peers.heard(owner, Text(with_crc("H:ROS2-R4;")));
  ASSERT_NE(host, Peers::nobody);
  std::string damaged = with_crc("H:ROS2-R4;");
  damaged[3] = 'x';
  for (int i = 0; i < 3000; ++i) {
    EXPECT_EQ(peers.heard(i, Text("x")), Peers::nobody);
    EXPECT_EQ(peers.heard(i, Text(damaged)), Peers::nobody);
    EXPECT_EQ(peers.heard(i, Text()), Peers::nobody);
  }
  EXPECT_EQ(peers.audience(), host);
  EXPECT_EQ(peers.heard(owner, Text(with_crc("H:ROS2-R4;"))), host);
}

TEST(PeerTable, KeepsTheControllingHostInAFlood) {
  Peers peers;
  const std::uint32_t number = peers.heard(owner);
  peers.hold(number);
  for (int i = 0; i < 50000; ++i) peers.heard(i);
  ASSERT_NE(peers.find(number), nullptr);
  EXPECT_EQ(peers.heard(owner), number);
}

TEST(PeerTable, AddressesTheControllingHostWhateverOthersSend) {
  Peers peers;
  const std::uint32_t number = peers.heard(owner);
  const std::uint32_t stranger = peers.heard(1);
  EXPECT_EQ(peers.audience(), stranger) << "no host is in control";
  peers.hold(number);
  EXPECT_EQ(peers.audience(), number);
  for (int i = 0; i < 1000; ++i) peers.heard(i, Text(with_crc("H:ROS2-R4;")));
  EXPECT_EQ(peers.audience(), number);
  peers.heard(owner);
  EXPECT_EQ(peers.audience(), number);

  peers.hold(Peers::nobody);
  EXPECT_EQ(peers.audience(), number) << "until another peer sends";
  const std::uint32_t next = peers.heard(2000);
  EXPECT_EQ(peers.audience(), next);
  for (int i = 0; i < 1000; ++i) peers.heard(i);
  EXPECT_EQ(peers.heard(owner), number) << "the host may come back";
}

TEST(PeerTable, AWatcherIsNotAddressed) {
  const std::string watch = with_crc("W:50;PNum:5;T:0;");
  const std::string heartbeat = with_crc("H:ROS2-R4;");
  Peers peers;
  const std::uint32_t watcher = peers.heard(1, Text(watch));
  EXPECT_TRUE(peers.watches(watcher));
  EXPECT_EQ(peers.audience(), Peers::nobody);
  peers.heard(1, Text(with_crc("Q:ID;")));
  EXPECT_EQ(peers.audience(), Peers::nobody) << "a watcher may ask questions";
  const std::uint32_t host = peers.heard(owner, Text(heartbeat));
  peers.heard(1, Text(watch));
  EXPECT_EQ(peers.audience(), host);
  peers.heard(1, Text(heartbeat));
  EXPECT_FALSE(peers.watches(watcher));
  EXPECT_EQ(peers.audience(), watcher) << "the watcher became a host";
}

TEST(PeerTable, ALeaseRequestDoesNotMakeTheControllingHostAWatcher) {
  Peers peers;
  const std::uint32_t host = peers.heard(owner, Text(with_crc("H:ROS2-R4;")));
  peers.hold(host);
  peers.heard(owner, Text(with_crc("W:50;PNum:5;T:0;")));
  EXPECT_FALSE(peers.watches(host)) << "the address of the watcher's datagram was forged";
}

TEST(PeerTable, KeepsEveryPeerOfTheControllingHost) {
  Peers peers;
  const std::uint32_t first = peers.heard(1);
  const std::uint32_t second = peers.heard(2);
  peers.also_hold(second);  // no host is in control
  peers.hold(first);
  peers.also_hold(second);
  peers.also_hold(second);
  peers.also_hold(Peers::nobody);
  for (int i = 0; i < 1000; ++i) peers.heard(100 + i);
  EXPECT_EQ(peers.heard(1), first);
  EXPECT_EQ(peers.heard(2), second);
  peers.hold(Peers::nobody);  // the host may reconnect
  for (int i = 0; i < 1000; ++i) peers.heard(100 + i);
  EXPECT_EQ(peers.heard(2), second);
  peers.hold(first);
  for (int i = 0; i < 1000; ++i) peers.heard(100 + i);
  EXPECT_NE(peers.heard(2), second) << "its place is free for others";
  EXPECT_EQ(peers.heard(1), first);
}

TEST(PeerTable, LetsANewHostInDuringAFlood) {
  Peers peers;
  for (int i = 0; i < 5000; ++i) peers.heard(i);
  const std::uint32_t number = peers.heard(owner);
  // Other peers send before the board decides which host has control.
  for (int i = 1; i < Peers::capacity; ++i) peers.heard(10000 + i);
  peers.hold(number);
  for (int i = 0; i < 5000; ++i) peers.heard(i);
  EXPECT_EQ(peers.heard(owner), number);
}

TEST(PeerTable, ReleasesTheEarlierHostWhenAnotherTakesControl) {
  Peers peers;
  const std::uint32_t before = peers.heard(owner);
  peers.hold(before);
  const std::uint32_t now = peers.heard(-2);
  peers.hold(now);
  for (int i = 0; i < Peers::capacity; ++i) peers.heard(i);
  EXPECT_EQ(peers.find(before), nullptr);
  EXPECT_EQ(peers.heard(-2), now);
}

}  // namespace
}  // namespace r4::test
