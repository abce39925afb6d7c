// SPDX-License-Identifier: GPL-3.0-or-later
// The data that the loop and the threads exchange.
#include <gtest/gtest.h>

#include <atomic>
#include <string>
#include <thread>

#include "firmware/ports/giga/links/datagram_ring.hpp"
#include "firmware/ports/giga/links/hand_over.hpp"
#include "firmware/ports/giga/links/udp_peers.hpp"
#include "firmware/ports/giga/links/udp_port.hpp"
#include "tests/support/datagrams.hpp"

namespace r4::test {
namespace {

std::uint32_t now_ms = 0;
std::uint32_t clock_ms() { return now_ms; }

TEST(DatagramRing, GivesDatagramsWholeAndInOrder) {
  giga::DatagramRing<256> ring;
  giga::DatagramNote note;
  note.peer = 7;
  note.time_ms = 5;
  note.priority = Priority::state;
  EXPECT_TRUE(ring.put(note, "first"));
  EXPECT_TRUE(ring.put(giga::DatagramNote(), "second"));
  giga::DatagramNote taken;
  char buffer[max_datagram];
  Text text;
  ASSERT_TRUE(ring.take(taken, buffer, text));
  EXPECT_EQ(str(text), "first");
  EXPECT_EQ(taken.peer, 7U);
  EXPECT_EQ(taken.time_ms, 5U);
  EXPECT_EQ(taken.priority, Priority::state);
  ASSERT_TRUE(ring.take(taken, buffer, text));
  EXPECT_EQ(str(text), "second");
  EXPECT_FALSE(ring.take(taken, buffer, text));
}

TEST(DatagramRing, RefusesADatagramThatDoesNotFitAndWrapsAround) {
  giga::DatagramRing<256> ring;
  giga::DatagramNote note;
  char buffer[max_datagram];
  Text text;
  const std::string datagram(60, 'x');
  for (int round = 0; round < 50; ++round) {
    int put = 0;
    while (ring.put(note, Text(datagram))) ++put;
    EXPECT_EQ(put, 3);
    for (int i = 0; i < put; ++i) {
      ASSERT_TRUE(ring.take(note, buffer, text));
      EXPECT_EQ(str(text), datagram);
    }
  }
  EXPECT_FALSE(ring.put(note, "x", 250)) << "some room is reserved";
}

TEST(DatagramRing, TransfersDatagramsBetweenThreadsWithoutLoss) {
  static giga::DatagramRing<1024> ring;
  std::thread producer([] {
    giga::DatagramNote note;
    for (int i = 0; i < 20000;) {
      const std::string text =
          std::to_string(i) + std::string(static_cast<std::size_t>(i % 90), '.');
      if (ring.put(note, Text(text))) {
        ++i;
      } else {
        std::this_thread::yield();  // the test must also work on one processor
      }
    }
  });
  giga::DatagramNote note;
  char buffer[max_datagram];
  Text text;
  for (int i = 0; i < 20000;) {
    if (!ring.take(note, buffer, text)) {
      std::this_thread::yield();
      continue;
    }
    ASSERT_EQ(str(text), std::to_string(i) + std::string(static_cast<std::size_t>(i % 90), '.'));
    ++i;
  }
  producer.join();
}

TEST(HandOver, GivesTheNewestValueOnceAndNeverAMixture) {
  struct Pair {
    std::uint32_t a;
    std::uint32_t b;
  };
  static giga::HandOver<Pair> place;
  std::uint32_t known = 0;
  Pair value{};
  EXPECT_FALSE(place.take(known, value));
  static std::atomic<bool> done{false};
  std::thread writer([] {
    for (std::uint32_t i = 1; i <= 20000; ++i) place.put({i, ~i});
    done = true;
  });
  std::uint32_t newest = 0;
  while (!done || newest != 20000) {
    if (!place.take(known, value)) continue;
    ASSERT_EQ(value.b, ~value.a);
    ASSERT_GT(value.a, newest);
    newest = value.a;
  }
  writer.join();
  EXPECT_FALSE(place.take(known, value));
}

const std::string hello = with_crc("H:ROS2-R4;");

TEST(UdpLink, GivesTheNetworkThreadThePeerInControl) {
  giga::UdpLink link;
  giga::UdpPort port(link, &clock_ms);
  EXPECT_EQ(link.held(0), everyone);
  port.hold(7);
  EXPECT_EQ(link.held(0), 7U);
  port.also_hold(9);
  port.also_hold(7);
  port.also_hold(everyone);
  EXPECT_EQ(link.held(1), 9U) << "the second path's peer";
  EXPECT_EQ(link.held(2), everyone);
  port.hold(8);
  EXPECT_EQ(link.held(0), 8U);
  EXPECT_EQ(link.held(1), everyone);
}

TEST(UdpPeers, SendToBothPortsOfThePapersClient) {
  giga::UdpPeers peers;
  giga::UdpAddress to[2];
  EXPECT_EQ(peers.find(everyone, to), 0) << "no peer is known";
  peers.set_host(77);
  ASSERT_EQ(peers.find(everyone, to), 1) << "the set host, before it is heard";
  EXPECT_EQ(to[0].ip, 77U);
  EXPECT_EQ(to[0].port, 2390);
  const std::uint32_t number = peers.heard({77, 50000}, Text(hello));
  ASSERT_EQ(peers.find(number, to), 2);
  EXPECT_EQ(to[0].port, 50000) << "a search, or another program on that computer";
  EXPECT_EQ(to[1].ip, 77U);
  EXPECT_EQ(to[1].port, 2390) << "the client asks from another socket";
  const std::uint32_t same = peers.heard({77, 2390}, Text(hello));
  ASSERT_EQ(peers.find(same, to), 1);
  EXPECT_EQ(to[0].port, 2390);
  const std::uint32_t other = peers.heard({78, 50001}, Text(hello));
  ASSERT_EQ(peers.find(other, to), 1);
  EXPECT_EQ(to[0].port, 50001);
}

TEST(UdpPeers, SendToAWatcherOnlyAtItsPort) {
  giga::UdpPeers peers;
  giga::UdpAddress to[2];
  peers.set_host(77);
  const std::uint32_t watcher = peers.heard({77, 50000}, Text(with_crc("W:50;PNum:5;T:0;")));
  ASSERT_EQ(peers.find(watcher, to), 1);
  EXPECT_EQ(to[0].port, 50000);
}

TEST(UdpLink, StatesForWatchersLeaveRoomForTheHost) {
  giga::UdpLink link;
  giga::UdpPort port(link, &clock_ms);
  link.set_up(true);
  EXPECT_FALSE(port.receive([](std::uint32_t, Text) {}));
  port.hold(1);
  const std::string state(300, 'x');
  for (int i = 0; i < 20; ++i) port.send(Text(state), Priority::state, 2);
  const std::uint32_t dropped = port.dropped();
  EXPECT_GT(dropped, 0U) << "the network thread is not running";
  for (int i = 0; i < 3; ++i) port.send(Text(state), Priority::state, 1);
  EXPECT_EQ(port.dropped(), dropped);
  for (int i = 0; i < 3; ++i) port.send(Text(state), Priority::normal, 2);
  EXPECT_EQ(port.dropped(), dropped) << "room for answers remains";
}

TEST(UdpLink, ADelayedThreadSendsNoOldStates) {
  giga::UdpLink link;
  giga::UdpPort port(link, &clock_ms);
  link.set_up(true);
  EXPECT_FALSE(port.receive([](std::uint32_t, Text) {}));
  for (int i = 0; i < 300; ++i) {
    now_ms += 10;
    port.send("AIN24:24.28;", Priority::state, 1);
    if (i % 50 == 0) port.send("H:R4-ROS2;", Priority::normal, 1);
  }
  EXPECT_GT(port.dropped(), 0U);
  std::uint32_t peer = 0;
  char buffer[max_datagram];
  Text text;
  int heartbeats = 0;
  while (link.take(now_ms, peer, buffer, text)) {
    ASSERT_EQ(str(text), "H:R4-ROS2;") << "not an old state";
    ++heartbeats;
  }
  EXPECT_EQ(heartbeats, 6) << "states left room for answers";
  now_ms += 10;
  port.send("AIN24:24.29;", Priority::state, 1);
  ASSERT_TRUE(link.take(now_ms, peer, buffer, text));
  EXPECT_EQ(str(text), "AIN24:24.29;");
}

TEST(UdpLink, NotifiesTheLoopOnceThatTheNetworkIsLost) {
  giga::UdpLink link;
  giga::UdpPort port(link, &clock_ms);
  const auto receive = [&] { return port.receive([](std::uint32_t, Text) {}); };
  EXPECT_FALSE(receive()) << "the network was never up";
  link.set_up(true);
  EXPECT_FALSE(receive());
  link.set_up(false);
  EXPECT_TRUE(receive());
  EXPECT_FALSE(receive());
}

}  // namespace
}  // namespace r4::test
