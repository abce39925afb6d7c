// SPDX-License-Identifier: GPL-3.0-or-later
// A UDP host whose network disappears and returns. Each test runs in a separate network
// (network_namespaces(7)) and in a separate process, because a process cannot leave its network.
#include <arpa/inet.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <atomic>
#include <cstdio>
#include <cstring>
#include <memory>

#include "../../recorder.hpp"
#include "tests/support/datagrams.hpp"
#include "transports/file_descriptor.hpp"
#include "transports/udp/udp_host.hpp"

namespace r4::test {
namespace {

bool enter_a_network_of_our_own() {
  return ::unshare(CLONE_NEWNET) == 0 || ::unshare(CLONE_NEWUSER | CLONE_NEWNET) == 0;
}

// Sets or removes the address of an interface of the separate network, the loopback or its alias.
bool set_address(const char* interface, const char* dotted) {
  const FileDescriptor control(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  ifreq request{};
  std::snprintf(request.ifr_name, sizeof request.ifr_name, "lo");
  request.ifr_flags = IFF_UP;
  if (::ioctl(control.get(), SIOCSIFFLAGS, &request) != 0) return false;
  std::snprintf(request.ifr_name, sizeof request.ifr_name, "%s", interface);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  ::inet_pton(AF_INET, dotted, &address.sin_addr);
  std::memcpy(&request.ifr_addr, &address, sizeof address);
  return ::ioctl(control.get(), SIOCSIFADDR, &request) == 0;
}
constexpr const char* second_address = "10.9.0.1";
bool set_second(bool on) { return set_address("lo:1", on ? second_address : "0.0.0.0"); }
bool set_loopback(bool on) { return set_address("lo", on ? "127.0.0.1" : "0.0.0.0"); }

int lose_and_regain_the_network() {
  if (!enter_a_network_of_our_own()) return 10;
  asio::io_context io;
  Recorder at_board, at_host;
  const std::string url = "udp://127.0.0.1:20180";
  const auto error = error_of([&] { open_carrier(io, url, Role::host, at_host); });
  if (!error || error->kind() != ErrorKind::open || error->problem().fix.empty()) return 11;
  if (!set_loopback(true)) return 12;
  const auto board = open_carrier(io, url, Role::board, at_board);
  const auto host = open_carrier(io, url, Role::host, at_host);
  host->send("1", Priority::normal);
  if (!run_until(io, [&] { return at_board.has("1"); })) return 13;

  if (!set_loopback(false)) return 14;
  const auto lost = Clock::now();
  if (host->send("2", Priority::normal) != SendResult::down) return 15;
  if (!run_until(io, [&] { return at_host.count(Kind::down) == 1; })) return 16;
  if (host->up() || at_host.last(Kind::down)->problem.fix.empty()) return 17;
  if (at_host.last(Kind::down)->when - lost > std::chrono::milliseconds(50)) return 18;

  if (!set_loopback(true)) return 19;
  const auto back = Clock::now();
  if (!run_until(io, [&] { return at_host.count(Kind::up) == 2; })) return 20;
  if (at_host.last(Kind::up)->when - back > std::chrono::seconds(1)) return 21;
  host->send("3", Priority::normal);
  if (!run_until(io, [&] { return at_board.has("3"); })) return 22;
  if (host->counters().downs != 1 || host->counters().ups != 2) return 23;

  if (!set_loopback(false)) return 24;  // this time the host sends no datagram
  const auto lost_again = Clock::now();
  if (!run_until(io, [&] { return at_host.count(Kind::down) == 2; })) return 25;
  if (at_host.last(Kind::down)->when - lost_again > std::chrono::milliseconds(50)) return 26;
  return set_loopback(true) && run_until(io, [&] { return at_host.count(Kind::up) == 3; }) ? 0 : 27;
}

TEST(UdpNetwork, IsReportedWhenLostAndRecoversByItself) {
  EXPECT_EQ(run_in_child(lose_and_regain_the_network), 0);
}

// Two boards at one port of the host. The network of the second board is lost for half a second.
int lose_the_network_of_the_second() {
  if (!enter_a_network_of_our_own() || !set_loopback(true)) return 10;
  if (!set_second(true)) return 11;
  asio::io_context io;
  Recorder at_board[2], at_host[2];
  std::unique_ptr<Carrier> board[2], host[2];
  for (const std::size_t which : {0U, 1U}) {
    const std::string url =
        fmt::format("udp://{}:20180", which == 0 ? "127.0.0.1" : second_address);
    board[which] = open_carrier(io, url, Role::board, at_board[which]);
    host[which] = open_carrier(io, url, Role::host, at_host[which]);
    at_board[which].then = [&board, which](const Recorder::Datagram& asked) {
      board[which]->send(asked.text, Priority::normal, asked.from);
    };
  }
  const auto answers = [&](std::size_t which, const std::string& text) {
    host[which]->send(with_crc(text + ":;"), Priority::normal);
    return run_until(io, [&] { return at_host[which].has(with_crc(text + ":;")); });
  };
  if (!answers(0, "both") || !answers(1, "both")) return 12;

  if (!set_second(false)) return 13;
  if (host[1]->send("into the void", Priority::normal) != SendResult::down) return 14;
  const auto lost = Clock::now();
  for (int i = 0; Clock::now() - lost < std::chrono::milliseconds(500); ++i) {
    if (!answers(0, std::to_string(i))) return 15;
  }
  if (host[1]->up() || host[1]->counters().rx_foreign != 0) return 16;

  if (!set_second(true)) return 17;
  if (!run_until(io, [&] { return host[1]->up(); })) return 18;
  return answers(0, "again") && answers(1, "again") ? 0 : 19;
}

TEST(UdpNetwork, LossForASecondBoardDoesNotAffectTheFirst) {
  EXPECT_EQ(run_in_child(lose_the_network_of_the_second), 0);
}

// The address from which the host sends is removed.
int lose_the_address_that_is_sent_from() {
  if (!enter_a_network_of_our_own() || !set_loopback(true) || !set_second(true)) return 10;
  asio::io_context io;
  Recorder at_host;
  const std::string url = fmt::format("udp://127.0.0.1:20180?local={}", second_address);
  const auto host = open_carrier(io, url, Role::host, at_host);
  if (!set_second(false)) return 11;
  if (!run_until(io, [&] { return at_host.count(Kind::down) == 1; })) return 12;
  const std::string words =
      fmt::format("this computer does not have the address {}", second_address);
  const Problem& lost = at_host.last(Kind::down)->problem;
  if (lost.reason.find(words) != 0 || lost.fix.empty()) return 13;
  if (!set_second(true)) return 14;
  return run_until(io, [&] { return at_host.count(Kind::up) == 2; }) ? 0 : 15;
}

TEST(UdpNetwork, NamesTheLostAddressOfThisComputer) {
  EXPECT_EQ(run_in_child(lose_the_address_that_is_sent_from), 0);
}

// ThreadSanitizer does not allow a child of a program with threads to start a thread, as a lookup
// does.
#ifndef R4_THREAD_SANITIZER
// The board moves to another address while the network of its old address is lost. The host follows
// the board.
int follow_the_board_out_of_a_lost_network() {
  if (!enter_a_network_of_our_own() || !set_loopback(true) || !set_second(true)) return 10;
  asio::io_context io;
  Recorder at_board, at_host;
  const auto moved = std::make_shared<std::atomic<bool>>(false);
  HostLookup lookup;
  lookup.resolve = [moved](const std::string&) {  // runs in a thread that may outlive the test
    FoundHost found;
    found.addresses = {asio::ip::make_address(*moved ? "127.0.0.1" : second_address)};
    return found;
  };
  lookup.retry = lookup.silence = std::chrono::milliseconds{10};
  const auto board = open_carrier(io, "udp://127.0.0.1:20180", Role::board, at_board);
  const std::unique_ptr<Carrier> host = std::make_unique<UdpHost>(
      io, Url::parse("udp://board.test:20180"), std::make_shared<DeviceClaim>(), lookup);
  host->open(at_host);
  if (!set_second(false)) return 11;
  if (!run_until(io, [&] { return at_host.count(Kind::down) == 1; })) return 12;
  *moved = true;
  if (!run_until(io, [&] { return at_host.count(Kind::up) == 2; })) return 13;
  if (host->send(with_crc("there:;"), Priority::normal) != SendResult::sent) return 14;
  if (!run_until(io, [&] { return at_board.has(with_crc("there:;")); })) return 15;
  return host->up() && host->counters().downs == 1 && at_host.count(Kind::down) == 1 ? 0 : 16;
}

TEST(UdpNetwork, LossIsReportedOnceIfTheBoardMoves) {
  EXPECT_EQ(run_in_child(follow_the_board_out_of_a_lost_network), 0);
}
#endif

}  // namespace
}  // namespace r4::test
