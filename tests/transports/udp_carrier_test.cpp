// SPDX-License-Identifier: GPL-3.0-or-later
#include "transports/udp_carrier.hpp"

#include <gtest/gtest.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <asio/ip/udp.hpp>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <vector>

#include "recorder.hpp"
#include "tests/support/datagrams.hpp"
#include "transports/file_descriptor.hpp"

namespace r4::test {
namespace {

using asio::ip::udp;

std::string port_of(const Carrier& board) {
  const std::string address = board.name().substr(0, board.name().find('?'));
  return address.substr(address.rfind(':') + 1);
}

// A board answers only what is a datagram.
std::string valid(std::string_view name) { return with_crc(std::string(name) + ":;"); }

// Another program's socket.
class Socket {
 public:
  Socket(asio::io_context& io, const char* address, unsigned short port = 0)
      : socket_(io, udp::endpoint(asio::ip::make_address(address), port)) {
    socket_.non_blocking(true);
  }
  std::string port() const { return std::to_string(socket_.local_endpoint().port()); }
  void send(std::string_view text, const std::string& port, const char* address = "127.0.0.1") {
    socket_.send_to(asio::buffer(text),
                    udp::endpoint(asio::ip::make_address(address),
                                  static_cast<unsigned short>(std::stoi(port))));
  }
  // Empty if nothing is there.
  std::string receive() {
    char buffer[2048];
    asio::error_code error;
    udp::endpoint from;
    const std::size_t size = socket_.receive_from(asio::buffer(buffer), from, 0, error);
    return error ? std::string() : std::string(buffer, size);
  }

 private:
  udp::socket socket_;
};

class UdpCarrierTest : public testing::Test {
 protected:
  void open_board(const std::string& query = "") {
    board = open_carrier(io, "udp://127.0.0.1:0" + query, Role::board, at_board);
  }
  void open_host() {
    host =
        open_carrier(io, "udp://127.0.0.1:" + port_of(*board) + "?listen=0", Role::host, at_host);
  }
  bool wait_for(const Recorder& recorder, std::string_view text) {
    return run_until(io, [&] { return recorder.has(text); });
  }

  asio::io_context io;
  Recorder at_board, at_host;
  std::unique_ptr<Carrier> board, host;
};

TEST_F(UdpCarrierTest, CarriesBothWays) {
  open_board();
  open_host();
  EXPECT_TRUE(board->up() && host->up());
  EXPECT_EQ(at_host.count(Kind::up), 1U);
  EXPECT_EQ(host->send(valid("question"), Priority::normal), SendResult::sent);
  ASSERT_TRUE(wait_for(at_board, valid("question")));
  EXPECT_EQ(board->send("answer", Priority::normal, at_board.datagrams[0].from), SendResult::sent);
  ASSERT_TRUE(wait_for(at_host, "answer"));
  EXPECT_EQ(at_host.datagrams[0].from, everyone);
  EXPECT_EQ(host->counters().tx_bytes, valid("question").size());
  EXPECT_EQ(board->counters().rx_bytes, valid("question").size());
  EXPECT_EQ(board->counters().rx_datagrams, 1U);
  EXPECT_GE(at_host.drained, 1);
}

TEST_F(UdpCarrierTest, CarriesOverIpv6) {
  board = open_carrier(io, "udp://[::1]:0", Role::board, at_board);
  host = open_carrier(io, "udp://[::1]:" + port_of(*board) + "?listen=0", Role::host, at_host);
  EXPECT_EQ(host->name().find("udp://[::1]:"), 0U);
  host->send(valid("question"), Priority::normal);
  ASSERT_TRUE(wait_for(at_board, valid("question")));
  board->send("answer", Priority::normal);
  ASSERT_TRUE(wait_for(at_host, "answer"));
}

TEST_F(UdpCarrierTest, ServesIpv4HostsOnAnIpv6Socket) {
  Socket peer(io, "127.0.0.1");
  board = open_carrier(io, "udp://[::]:0?peer=127.0.0.1:" + peer.port(), Role::board, at_board);
  EXPECT_EQ(board->send("state", Priority::state), SendResult::sent);
  std::string received;
  ASSERT_TRUE(run_until(io, [&] { return !(received = peer.receive()).empty(); }));
  EXPECT_EQ(received, "state");
  open_host();
  host->send("question", Priority::normal);
  ASSERT_TRUE(wait_for(at_board, "question"));
}

TEST_F(UdpCarrierTest, SendsForEveryoneToTheHostHeardLast) {
  open_board();
  EXPECT_EQ(board->send("nobody is there", Priority::state), SendResult::down);
  Recorder at_second;
  open_host();
  const auto second =
      open_carrier(io, "udp://127.0.0.1:" + port_of(*board) + "?listen=0", Role::host, at_second);
  host->send(valid("first"), Priority::normal);
  ASSERT_TRUE(wait_for(at_board, valid("first")));
  second->send(valid("second"), Priority::normal);
  ASSERT_TRUE(wait_for(at_board, valid("second")));
  const Peer first = at_board.datagrams[0].from;
  EXPECT_NE(first, at_board.datagrams[1].from);
  EXPECT_NE(first, everyone);
  board->send("for everyone", Priority::state);
  board->send("for the first", Priority::normal, first);
  ASSERT_TRUE(wait_for(at_second, "for everyone"));
  ASSERT_TRUE(wait_for(at_host, "for the first"));
  EXPECT_EQ(at_host.datagrams.size(), 1U);
  EXPECT_EQ(at_second.datagrams.size(), 1U);
}

TEST_F(UdpCarrierTest, AnswersThePapersClientWhereItListensAndWhereItAsks) {
  Socket listening(io, "127.0.0.1");
  Socket asking(io, "127.0.0.1");
  open_board("?peer=127.0.0.1:" + listening.port());
  asking.send(valid("command"), port_of(*board));
  ASSERT_TRUE(wait_for(at_board, valid("command")));
  const Peer peer = at_board.datagrams[0].from;
  board->send("state", Priority::state);
  board->send("answer", Priority::normal, peer);
  std::vector<std::string> heard;
  ASSERT_TRUE(run_until(io, [&] {
    if (std::string text = listening.receive(); !text.empty()) heard.push_back(text);
    return heard.size() == 2;
  }));
  EXPECT_EQ(heard, (std::vector<std::string>{"state", "answer"}));
  EXPECT_EQ(asking.receive(), "answer");
  EXPECT_EQ(asking.receive(), "");

  listening.send(valid("from-the-peer-itself"), port_of(*board));
  ASSERT_TRUE(wait_for(at_board, valid("from-the-peer-itself")));
  board->send("once", Priority::normal, at_board.datagrams[1].from);
  ASSERT_TRUE(run_until(io, [&] { return listening.receive() == "once"; }));
  EXPECT_EQ(listening.receive(), "");
}

TEST_F(UdpCarrierTest, HearsTheBoardFromAnyPortAndNobodyElse) {
  open_board();
  open_host();
  const std::string listen = host->name().substr(host->name().find("listen=") + 7);
  Socket stranger(io, "127.0.0.2");
  Socket other_port(io, "127.0.0.1");
  stranger.send("stranger", listen);
  other_port.send("board", listen);
  ASSERT_TRUE(wait_for(at_host, "board"));
  EXPECT_EQ(at_host.datagrams.size(), 1U);
  EXPECT_EQ(host->counters().rx_foreign, 1U);
  EXPECT_EQ(host->counters().rx_datagrams, 1U);
}

TEST_F(UdpCarrierTest, CountsAndDropsWhatIsTooLong) {
  open_board();
  open_host();
  Socket raw(io, "127.0.0.1");
  raw.send(std::string(1025, 'x'), port_of(*board));
  raw.send(std::string(60000, 'x'), port_of(*board));
  EXPECT_EQ(host->send(std::string(1025, 'y'), Priority::normal), SendResult::full);
  const std::string longest(1024, 'y');
  EXPECT_EQ(host->send(longest, Priority::normal), SendResult::sent);
  ASSERT_TRUE(wait_for(at_board, longest));
  EXPECT_EQ(at_board.datagrams.size(), 1U);
  EXPECT_EQ(board->counters().rx_oversize, 2U);
  EXPECT_EQ(host->counters().tx_errors, 1U);
}

TEST_F(UdpCarrierTest, ForgetsThePeerThatIsSilentLongest) {
  open_board();
  Socket first(io, "127.0.0.1");
  first.send(valid("first"), port_of(*board));
  ASSERT_TRUE(wait_for(at_board, valid("first")));
  std::vector<std::unique_ptr<Socket>> crowd;
  for (int i = 0; i < 100; ++i) {
    crowd.push_back(std::make_unique<Socket>(io, "127.0.0.1"));
    crowd.back()->send(valid(std::to_string(i)), port_of(*board));
  }
  ASSERT_TRUE(wait_for(at_board, valid("99")));
  EXPECT_EQ(board->send("too late", Priority::normal, at_board.datagrams[0].from),
            SendResult::down);
  EXPECT_EQ(board->send("answer", Priority::normal, at_board.datagrams.back().from),
            SendResult::sent);
  EXPECT_EQ(board->counters().tx_dropped, 1U);
  EXPECT_TRUE(board->up());
}

TEST_F(UdpCarrierTest, AnswersTheHostInControlHoweverManyOthersSend) {
  open_board();
  Socket owner(io, "127.0.0.1");
  owner.send(valid("owner"), port_of(*board));
  ASSERT_TRUE(wait_for(at_board, valid("owner")));
  const Peer number = at_board.datagrams[0].from;
  board->hold(number);
  std::vector<std::unique_ptr<Socket>> crowd;
  for (int i = 0; i < 100; ++i) {
    crowd.push_back(std::make_unique<Socket>(io, "127.0.0.1"));
    crowd.back()->send(valid(std::to_string(i)), port_of(*board));
  }
  ASSERT_TRUE(wait_for(at_board, valid("99")));
  EXPECT_EQ(board->send("answer", Priority::normal, number), SendResult::sent);
  EXPECT_TRUE(run_until(io, [&] { return owner.receive() == "answer"; }));
  owner.send(valid("again"), port_of(*board));
  ASSERT_TRUE(wait_for(at_board, valid("again")));
  EXPECT_EQ(at_board.datagrams.back().from, number);
}

TEST_F(UdpCarrierTest, TakesWhoeverSendsNoDatagramForNobody) {
  open_board();
  Socket host_socket(io, "127.0.0.1");
  Socket stranger(io, "127.0.0.1");
  host_socket.send(valid("host"), port_of(*board));
  ASSERT_TRUE(wait_for(at_board, valid("host")));
  stranger.send("x", port_of(*board));
  ASSERT_TRUE(wait_for(at_board, "x"));
  EXPECT_EQ(at_board.datagrams.back().from, everyone);
  board->send("for everyone", Priority::state);
  EXPECT_TRUE(run_until(io, [&] { return host_socket.receive() == "for everyone"; }));
  EXPECT_EQ(stranger.receive(), "");
}

TEST_F(UdpCarrierTest, SaysThatThePortIsInUse) {
  Socket other(io, "0.0.0.0");
  const auto error = error_of(
      [&] { open_carrier(io, "udp://127.0.0.1?listen=" + other.port(), Role::host, at_host); });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->kind(), ErrorKind::open);
  EXPECT_EQ(error->problem().reason, "UDP port " + other.port() + " is in use by another program");
  EXPECT_NE(error->problem().fix.find("?listen=0"), std::string::npos);
  const auto at_the_board =
      error_of([&] { open_carrier(io, "udp://0.0.0.0:" + other.port(), Role::board, at_board); });
  ASSERT_TRUE(at_the_board);
  EXPECT_EQ(at_the_board->kind(), ErrorKind::open);
}

TEST_F(UdpCarrierTest, SaysWhichHostItDoesNotFind) {
  const auto error = error_of(
      [&] { open_carrier(io, "udp://no-such-board.invalid?listen=0", Role::host, at_host); });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->kind(), ErrorKind::open);
  EXPECT_NE(error->problem().reason.find("no host 'no-such-board.invalid'"), std::string::npos);
  EXPECT_FALSE(error->problem().fix.empty());
}

TEST_F(UdpCarrierTest, SaysThatAnAddressIsNotOfThisMachine) {
  const auto error =
      error_of([&] { open_carrier(io, "udp://192.0.2.1:0", Role::board, at_board); });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->kind(), ErrorKind::open);
  EXPECT_NE(error->problem().fix.find("0.0.0.0"), std::string::npos);
}

TEST_F(UdpCarrierTest, SaysThatAPortIsNotPermitted) {
  const int status = run_unprivileged([] {
    asio::io_context child;
    Recorder recorder;
    const auto error =
        error_of([&] { open_carrier(child, "udp://127.0.0.1:1", Role::board, recorder); });
    return error && error->kind() == ErrorKind::permission ? 0 : 1;
  });
  std::ifstream limit("/proc/sys/net/ipv4/ip_unprivileged_port_start");
  int first_free = 1024;
  limit >> first_free;
  EXPECT_EQ(status, first_free > 1 ? 0 : 1);
}

TEST_F(UdpCarrierTest, TakesABoardThatIsOffForAQuietOne) {
  std::string port;
  {
    Socket gone(io, "127.0.0.1");
    port = gone.port();
  }
  host = open_carrier(io, "udp://127.0.0.1:" + port + "?listen=0", Role::host, at_host);
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(host->send("is anybody there", Priority::normal), SendResult::sent);
    run_for(io, std::chrono::milliseconds(1));
  }
  EXPECT_TRUE(host->up());
  EXPECT_EQ(at_host.events.size(), 1U);
  board = open_carrier(io, "udp://127.0.0.1:" + port, Role::board, at_board);
  host->send("now", Priority::normal);
  EXPECT_TRUE(wait_for(at_board, "now"));
}

TEST_F(UdpCarrierTest, HandsABurstOverWholeAndSaysWhenItIsDone) {
  open_board();
  Socket raw(io, "127.0.0.1");
  for (int i = 0; i < 100; ++i) raw.send(std::to_string(i), port_of(*board));
  ASSERT_TRUE(wait_for(at_board, "99"));
  EXPECT_EQ(at_board.datagrams.size(), 100U);
  for (std::size_t i = 0; i < 100; ++i) EXPECT_EQ(at_board.datagrams[i].text, std::to_string(i));
  EXPECT_EQ(at_board.drained, 1);
}

TEST_F(UdpCarrierTest, CallsNoHandlerAfterClose) {
  open_board();
  at_board.then = [&](const Recorder::Datagram&) { board->close(); };
  Socket raw(io, "127.0.0.1");
  raw.send("1", port_of(*board));
  raw.send("2", port_of(*board));
  ASSERT_TRUE(wait_for(at_board, "1"));
  run_for(io, std::chrono::milliseconds(5));
  EXPECT_EQ(at_board.datagrams.size(), 1U);
  EXPECT_EQ(at_board.drained, 0);
  EXPECT_EQ(board->send("x", Priority::normal), SendResult::down);
  at_board.then = nullptr;
  board->open(at_board);
  raw.send("3", port_of(*board));
  EXPECT_TRUE(wait_for(at_board, "3"));
}

TEST_F(UdpCarrierTest, LeaksNoDescriptorsOver100Reopenings) {
  open_board();
  open_host();
  const std::size_t before = open_descriptors();
  for (int i = 0; i < 100; ++i) {
    host->open(at_host);
    board->open(at_board);
  }
  host->close();
  board->close();
  host->close();
  EXPECT_LE(open_descriptors(), before);
}

// Gives the loopback interface of a network of our own its address, or takes it away.
bool set_loopback(bool on) {
  const FileDescriptor control(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  ifreq request{};
  std::snprintf(request.ifr_name, sizeof request.ifr_name, "lo");
  request.ifr_flags = IFF_UP;
  if (::ioctl(control.get(), SIOCSIFFLAGS, &request) != 0) return false;
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(on ? INADDR_LOOPBACK : INADDR_ANY);
  std::memcpy(&request.ifr_addr, &address, sizeof address);
  return ::ioctl(control.get(), SIOCSIFADDR, &request) == 0;
}

// In a child process, because a process cannot come back from a network of its own.
int lose_and_regain_the_network() {
  if (::unshare(CLONE_NEWNET) != 0 && ::unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0) return 10;
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
  std::printf("[ network lost: reported after %.2f ms ]\n",
              in_milliseconds(at_host.last(Kind::down)->when - lost));
  if (at_host.last(Kind::down)->when - lost > std::chrono::milliseconds(50)) return 18;

  if (!set_loopback(true)) return 19;
  const auto back = Clock::now();
  if (!run_until(io, [&] { return at_host.count(Kind::up) == 2; })) return 20;
  std::printf("[ network back: reported after %.2f ms ]\n",
              in_milliseconds(at_host.last(Kind::up)->when - back));
  if (at_host.last(Kind::up)->when - back > std::chrono::seconds(1)) return 21;
  host->send("3", Priority::normal);
  if (!run_until(io, [&] { return at_board.has("3"); })) return 22;
  return host->counters().downs == 1 && host->counters().ups == 2 ? 0 : 23;
}

TEST(UdpNetwork, IsReportedWhenLostAndComesBackByItself) {
  EXPECT_EQ(run_in_child(lose_and_regain_the_network), 0);
}

}  // namespace
}  // namespace r4::test
