// SPDX-License-Identifier: GPL-3.0-or-later
#include "transports/udp/udp_carrier.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <asio/ip/udp.hpp>
#include <fstream>
#include <future>
#include <vector>

#include "../recorder.hpp"
#include "tests/support/datagrams.hpp"
#include "tests/support/problems.hpp"
#include "transports/board_end.hpp"

namespace r4::test {
namespace {

using asio::ip::udp;

std::string port_of(const Carrier& board) {
  const std::string address = board.name().substr(0, board.name().find('?'));
  return address.substr(address.rfind(':') + 1);
}

// A board answers only valid datagrams.
std::string valid(std::string_view name) { return with_crc(std::string(name) + ":;"); }

class Socket {
 public:
  Socket(asio::io_context& io, const char* address, unsigned short port = 0)
      : socket_(io, udp::endpoint(asio::ip::make_address(address), port)) {
    socket_.non_blocking(true);
  }
  std::string port() const { return std::to_string(socket_.local_endpoint().port()); }
  // From now on the socket receives only from there, as a host receives from its board.
  void connect(const std::string& port, const char* address) {
    socket_.connect(endpoint(port, address));
  }
  void send(std::string_view text, const std::string& port, const char* address = "127.0.0.1") {
    socket_.send_to(asio::buffer(text), endpoint(port, address));
  }
  // Empty if nothing arrived.
  std::string receive() {
    char buffer[2048];
    asio::error_code error;
    udp::endpoint from;
    const std::size_t size = socket_.receive_from(asio::buffer(buffer), from, 0, error);
    return error ? std::string() : std::string(buffer, size);
  }

 private:
  static udp::endpoint endpoint(const std::string& port, const char* address) {
    return {asio::ip::make_address(address), static_cast<unsigned short>(std::stoi(port))};
  }

  udp::socket socket_;
};

class UdpCarrierTest : public testing::Test {
 protected:
  void open_board() { board = open_carrier(io, "udp://127.0.0.1:0", Role::board, at_board); }
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
  struct Case {
    std::string board;
    std::string host;
  };
  for (const Case& each :
       {Case{"udp://127.0.0.1:0", "udp://127.0.0.1:"}, Case{"udp://[::1]:0", "udp://[::1]:"},
        Case{"udp://[::]:0", "udp://[::1]:"}}) {
    SCOPED_TRACE(each.board);
    at_board = at_host = Recorder();
    board = open_carrier(io, each.board, Role::board, at_board);
    host = open_carrier(io, each.host + port_of(*board) + "?listen=0", Role::host, at_host);
    EXPECT_TRUE(board->up() && host->up());
    EXPECT_EQ(host->name().find(each.host), 0U);
    EXPECT_EQ(at_host.count(Kind::up), 1U);
    EXPECT_EQ(host->send(valid("question"), Priority::normal), SendResult::sent);
    ASSERT_TRUE(wait_for(at_board, valid("question")));
    const Peer asker = at_board.datagrams[0].from;
    EXPECT_EQ(board->send("answer", Priority::normal, asker), SendResult::sent);
    ASSERT_TRUE(wait_for(at_host, "answer"));
    EXPECT_EQ(at_host.datagrams[0].from, everyone);
    EXPECT_EQ(host->counters().tx_bytes, valid("question").size());
    EXPECT_EQ(board->counters().rx_bytes, valid("question").size());
    EXPECT_EQ(board->counters().rx_datagrams, 1U);
    EXPECT_GE(at_board.drained, 1);
    EXPECT_GE(at_host.drained, 1);
  }
}

TEST_F(UdpCarrierTest, AnswersFromTheAddressOfTheQuestion) {
  for (const std::string& url : {std::string("udp://0.0.0.0:0"), std::string("udp://[::]:0")}) {
    at_board = Recorder();
    board = open_carrier(io, url, Role::board, at_board);
    for (const char* const asked : {"127.0.0.1", "127.0.0.2", "127.0.0.3"}) {
      SCOPED_TRACE(url + ' ' + asked);
      Socket asker(io, "0.0.0.0");
      asker.connect(port_of(*board), asked);
      asker.send(valid(asked), port_of(*board), asked);
      ASSERT_TRUE(wait_for(at_board, valid(asked)));
      const Peer peer = at_board.datagrams.back().from;
      board->send("for one", Priority::normal, peer);
      board_end_of(*board).hold(peer);
      board->send("for all", Priority::state);
      EXPECT_TRUE(run_until(io, [&] { return asker.receive() == "for one"; }));
      EXPECT_TRUE(run_until(io, [&] { return asker.receive() == "for all"; }));
    }
  }
}

TEST_F(UdpCarrierTest, SendsStatesToTheControllingHostElseToTheHostHeardLast) {
  open_board();
  EXPECT_EQ(board->send("nobody is there", Priority::state), SendResult::down);
  Socket owner(io, "127.0.0.1");
  Socket stranger(io, "127.0.0.1");
  owner.send(valid("owner"), port_of(*board));
  stranger.send(valid("stranger"), port_of(*board));
  ASSERT_TRUE(wait_for(at_board, valid("stranger")));
  const Peer first = at_board.datagrams[0].from;
  EXPECT_NE(first, at_board.datagrams[1].from);
  EXPECT_NE(first, everyone);
  EXPECT_EQ(board->send("an unknown peer", Priority::normal, first + 100), SendResult::down);
  EXPECT_EQ(board->counters().tx_dropped, 2U);
  board->send("for everyone", Priority::state);
  board->send("for the first", Priority::normal, first);
  EXPECT_TRUE(run_until(io, [&] { return stranger.receive() == "for everyone"; }));
  EXPECT_TRUE(run_until(io, [&] { return owner.receive() == "for the first"; }));

  board_end_of(*board).hold(first);
  stranger.send(valid("later"), port_of(*board));
  ASSERT_TRUE(wait_for(at_board, valid("later")));
  board->send("state", Priority::state);
  EXPECT_TRUE(run_until(io, [&] { return owner.receive() == "state"; }));
  EXPECT_EQ(stranger.receive(), "");

  board_end_of(*board).hold(everyone);  // the host loses control
  stranger.send(valid("again"), port_of(*board));
  ASSERT_TRUE(wait_for(at_board, valid("again")));
  board->send("for anybody", Priority::state);
  EXPECT_TRUE(run_until(io, [&] { return stranger.receive() == "for anybody"; }));
  EXPECT_EQ(owner.receive(), "");
}

TEST_F(UdpCarrierTest, AnswersThePaperClientOnBothOfItsPorts) {
  for (const std::string& url : {std::string("udp://127.0.0.1:0"), std::string("udp://[::]:0")}) {
    SCOPED_TRACE(url);
    Socket listening(io, "127.0.0.1");
    Socket asking(io, "127.0.0.1");
    at_board = Recorder();
    board = open_carrier(io, url + "?peer=127.0.0.1:" + listening.port(), Role::board, at_board);
    asking.send(valid("command"), port_of(*board));
    ASSERT_TRUE(wait_for(at_board, valid("command")));
    EXPECT_EQ(board->send("state", Priority::state), SendResult::sent);
    board->send("answer", Priority::normal, at_board.datagrams[0].from);
    EXPECT_TRUE(run_until(io, [&] { return listening.receive() == "state"; }));
    EXPECT_TRUE(run_until(io, [&] { return listening.receive() == "answer"; }));
    EXPECT_EQ(asking.receive(), "answer");
    EXPECT_EQ(asking.receive(), "");

    listening.send(valid("from-the-peer-itself"), port_of(*board));
    ASSERT_TRUE(wait_for(at_board, valid("from-the-peer-itself")));
    board->send("once", Priority::normal, at_board.datagrams[1].from);
    EXPECT_TRUE(run_until(io, [&] { return listening.receive() == "once"; }));
    EXPECT_EQ(listening.receive(), "");
  }
}

TEST_F(UdpCarrierTest, HearsOnlyTheBoardAtItsPort) {
  open_board();
  open_host();
  const std::string listen = host->name().substr(host->name().find("listen=") + 7);
  Socket(io, "127.0.0.2").send("stranger", listen);
  Socket(io, "127.0.0.1").send("other port", listen);
  ASSERT_TRUE(run_until(io, [&] { return host->counters().rx_foreign == 2; }));
  EXPECT_TRUE(at_host.datagrams.empty());
  EXPECT_EQ(host->counters().rx_datagrams, 0U);
}

TEST_F(UdpCarrierTest, DropsTooLongDatagramsAndReportsTheirBeginning) {
  open_board();
  Socket raw(io, "127.0.0.1");
  host = open_carrier(io, "udp://127.0.0.1:" + raw.port() + "?listen=0", Role::host, at_host);
  const std::string listen = host->name().substr(host->name().find("listen=") + 7);
  raw.send(std::string(1025, 'x'), port_of(*board));
  raw.send(std::string(60000, 'x'), port_of(*board));
  Socket(io, "127.0.0.2").send(std::string(1025, 's'), listen);
  raw.send(std::string(1025, 'x'), listen);
  raw.send("board", listen);
  EXPECT_EQ(host->send(std::string(1025, 'y'), Priority::normal), SendResult::full);
  const std::string longest(1024, 'y');
  EXPECT_EQ(host->send(longest, Priority::normal), SendResult::sent);
  ASSERT_TRUE(run_until(io, [&] { return raw.receive() == longest; }));
  ASSERT_TRUE(wait_for(at_host, "board"));
  ASSERT_TRUE(run_until(io, [&] { return board->counters().rx_oversize == 2; }));
  EXPECT_TRUE(at_board.datagrams.empty());
  EXPECT_EQ(at_host.datagrams.size(), 1U);
  EXPECT_EQ(at_host.oversize, std::vector<std::string>{std::string(1024, 'x')});
  EXPECT_EQ(host->counters().rx_oversize, 1U);
  EXPECT_EQ(host->counters().tx_errors, 1U);
}

TEST_F(UdpCarrierTest, SaysWhyItCannotBeOpened) {
  Socket other(io, "0.0.0.0");
  const std::string in_use = fmt::format("UDP port {} is in use by {} (pid {})", other.port(),
                                         program_invocation_short_name, ::getpid());
  struct Case {
    std::string url;
    Role role;
    std::string reason, fix;
  };
  for (const Case& each : {
           Case{"udp://127.0.0.1?listen=" + other.port(), Role::host, in_use, "?listen=0"},
           Case{"udp://0.0.0.0:" + other.port(), Role::board, in_use, "another port"},
           Case{"udp://no-such-board.invalid?listen=0", Role::host,
                "the host 'no-such-board.invalid' was not found", "check the name"},
           Case{"udp://192.0.2.1:0", Role::board, "cannot be opened on 192.0.2.1", "0.0.0.0"},
           Case{"udp://127.0.0.1:20180?listen=0&local=10.254.77.9", Role::host,
                "this computer does not have the address 10.254.77.9 at the moment", "ip address"},
       }) {
    const Problem problem = problem_of([&] { open_carrier(io, each.url, each.role, at_host); });
    EXPECT_EQ(problem.kind, ErrorKind::open) << each.url;
    EXPECT_EQ(problem.thing, each.url);
    EXPECT_TRUE(contains(problem.reason, each.reason));
    EXPECT_TRUE(contains(problem.fix, each.fix));
  }
}

TEST_F(UdpCarrierTest, EquivalentUrlsHaveOneShareName) {
  const auto path = [](const char* url) { return udp_share_name(Url::parse(url)).text; };
  EXPECT_EQ(path("udp://localhost"), path("udp://127.0.0.1:2018?listen=2390"));
  EXPECT_EQ(path("udp://LocalHost"), path("udp://localhost"));
  EXPECT_EQ(path("udp://[0:0::1]"), path("udp://[::1]"));
  EXPECT_EQ(path("udp://Robot.local"), path("udp://robot.local"));
  EXPECT_NE(path("udp://127.0.0.2"), path("udp://127.0.0.1"));
  EXPECT_NE(path("udp://127.0.0.1:2019"), path("udp://127.0.0.1"));
  EXPECT_NE(path("udp://127.0.0.1?listen=2391"), path("udp://127.0.0.1"));
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

TEST_F(UdpCarrierTest, DeliversABurstAndReportsItsEnd) {
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

TEST_F(UdpCarrierTest, LeaksNoDescriptorsOver30Reopenings) {
  open_board();
  open_host();
  const std::size_t before = open_descriptors();
  for (int i = 0; i < 30; ++i) {
    host->open(at_host);
    board->open(at_board);
  }
  host->close();
  board->close();
  host->close();
  EXPECT_LE(open_descriptors(), before);
}

// Two boards of one program, which receives from both boards at one port.
class UdpTwoBoardsTest : public testing::Test {
 protected:
  struct Link {
    Recorder at_board, at_host;
    std::unique_ptr<Carrier> board, host;
  };

  // The system assigns ports from 32768 on to other tests, even while this port is closed.
  UdpTwoBoardsTest() { listen = std::to_string(20000 + ::getpid() % 10000); }

  void open_board(Link& link, const std::string& address) {
    link.board = open_carrier(io, "udp://" + address + ":0", Role::board, link.at_board);
    link.at_board.then = [&link](const Recorder::Datagram& datagram) {
      link.board->send("answer to " + datagram.text, Priority::normal, datagram.from);
    };
  }
  std::string url(const Link& link) const { return link.board->name() + "?listen=" + listen; }
  void open_host(Link& link) { link.host = open_carrier(io, url(link), Role::host, link.at_host); }
  // Both hosts send `count` questions at once. Each host receives the answers to its own questions.
  void talk(const std::string& name, int count) {
    std::vector<std::string> answers[2];
    for (Link& link : links) link.at_host.datagrams.clear();
    for (int i = 0; i < count; ++i) {
      for (const std::size_t which : {0U, 1U}) {
        const std::string question = valid(fmt::format("{}{}x{}", name, which, i));
        answers[which].push_back("answer to " + question);
        links[which].host->send(question, Priority::normal);
      }
    }
    for (const std::size_t which : {0U, 1U}) {
      const auto& heard = links[which].at_host.datagrams;
      ASSERT_TRUE(run_until(io, [&] { return heard.size() >= answers[which].size(); })) << name;
    }
    run_for(io, std::chrono::milliseconds(1));
    for (const std::size_t which : {0U, 1U}) {
      std::vector<std::string> texts;
      for (const auto& each : links[which].at_host.datagrams) texts.push_back(each.text);
      EXPECT_EQ(texts, answers[which]) << name;
    }
  }

  asio::io_context io;
  std::string listen;
  Link links[2];
};

TEST_F(UdpTwoBoardsTest, AreDistinguishedByTheirAddress) {
  open_board(links[0], "127.0.0.1");
  open_board(links[1], "127.0.0.2");
  for (Link& link : links) open_host(link);
  talk("both", 50);
  for (const char* address : {"127.0.0.1", "127.0.0.2"}) {
    Socket other_port(io, address);
    const std::uint64_t foreign = links[0].host->counters().rx_foreign;
    other_port.send("of another port", listen);
    EXPECT_TRUE(run_until(io, [&] { return links[0].host->counters().rx_foreign == foreign + 1; }));
    for (Link& link : links) EXPECT_FALSE(link.at_host.has("of another port"));
  }
}

TEST_F(UdpTwoBoardsTest, AreDistinguishedByTheirPortAtOneAddress) {
  for (Link& link : links) open_board(link, "127.0.0.1");
  for (const std::size_t first : {0U, 1U}) {
    open_host(links[first]);
    open_host(links[1 - first]);
    talk("order", 50);
    // A datagram of a third board at this address is for neither host.
    Socket third(io, "127.0.0.1");
    const std::uint64_t foreign = links[first].host->counters().rx_foreign;
    third.send("of a third", listen);
    EXPECT_TRUE(
        run_until(io, [&] { return links[first].host->counters().rx_foreign == foreign + 1; }));
    for (Link& link : links) EXPECT_FALSE(link.at_host.has("of a third"));
    for (Link& link : links) link.host->close();
  }
}

TEST_F(UdpTwoBoardsTest, OneMayCloseAndReopen) {
  for (Link& link : links) open_board(link, "127.0.0.1");
  for (Link& link : links) open_host(link);
  talk("both", 1);
  for (const std::size_t closed : {1U, 0U}) {
    Link& other = links[1 - closed];
    links[closed].host->close();
    const std::size_t before = other.at_host.datagrams.size();
    links[closed].board->send("to the closed one", Priority::normal);
    const std::string alone = valid("alone" + std::to_string(closed));
    other.host->send(alone, Priority::normal);
    ASSERT_TRUE(run_until(io, [&] { return other.at_host.has("answer to " + alone); }));
    EXPECT_EQ(other.at_host.datagrams.size(), before + 1);
    links[closed].host->open(links[closed].at_host);
    talk("again" + std::to_string(closed), 50);
  }
}

// A datagram of the second board that arrives before its host is open is not delivered to the first
// host.
TEST_F(UdpTwoBoardsTest, EarlyDatagramsOfTheSecondDoNotReachTheFirst) {
  for (Link& link : links) open_board(link, "127.0.0.1");
  open_host(links[0]);
  Socket raw(io, "127.0.0.1");
  raw.send("early", listen);
  const std::string second = "udp://127.0.0.1:" + raw.port() + "?listen=" + listen;
  const auto other = open_carrier(io, second, Role::host, links[1].at_host);
  ASSERT_TRUE(run_until(io, [&] { return links[0].host->counters().rx_foreign == 1; }));
  EXPECT_TRUE(links[0].at_host.datagrams.empty());
}

TEST_F(UdpTwoBoardsTest, RefuseTheSameBoardTwice) {
  open_board(links[0], "127.0.0.1");
  open_host(links[0]);
  const Problem problem =
      problem_of([&] { open_carrier(io, url(links[0]), Role::host, links[1].at_host); });
  EXPECT_EQ(problem.kind, ErrorKind::open);
  EXPECT_EQ(problem.reason, "this program has already opened that board");
  EXPECT_FALSE(problem.fix.empty());
  links[0].host->close();
  open_carrier(io, url(links[0]), Role::host, links[1].at_host);
}

TEST_F(UdpTwoBoardsTest, KeepThePortFromOtherPrograms) {
  open_board(links[0], "127.0.0.1");
  open_board(links[1], "127.0.0.2");
  for (Link& link : links) open_host(link);
  const auto tries_to_share = [&](const char* address) {
    udp::socket other(io, udp::v4());
    other.set_option(udp::socket::reuse_address(true));
    asio::error_code error;
    other.bind(udp::endpoint(asio::ip::make_address(address),
                             static_cast<unsigned short>(std::stoi(listen))),
               error);
    return error;
  };
  EXPECT_EQ(tries_to_share("0.0.0.0"), asio::error::address_in_use);
  EXPECT_EQ(tries_to_share("127.0.0.1"), asio::error::address_in_use);
  links[0].host->close();
  EXPECT_EQ(tries_to_share("0.0.0.0"), asio::error::address_in_use)
      << "the second host is still open";
  links[1].host->close();
  EXPECT_FALSE(tries_to_share("0.0.0.0"));
}

// The second host has a connected socket. The system reports to this socket that the board is off,
// which must not cost a datagram.
TEST_F(UdpTwoBoardsTest, AHostStaysUpAndLosesNothingIfItsBoardIsOff) {
  for (Link& off : links) {
    const std::string port = Socket(io, "127.0.0.1").port();
    off.host =
        open_carrier(io, "udp://127.0.0.1:" + port + "?listen=" + listen, Role::host, off.at_host);
    for (int i = 0; i < 5; ++i) {
      EXPECT_EQ(off.host->send("is anybody there", Priority::normal), SendResult::sent);
      run_for(io, std::chrono::milliseconds(1));
    }
    EXPECT_EQ(off.host->send("is anybody there", Priority::normal), SendResult::sent);
    EXPECT_TRUE(off.host->up());
    off.board = open_carrier(io, "udp://127.0.0.1:" + port, Role::board, off.at_board);
    EXPECT_EQ(off.host->send("now", Priority::normal), SendResult::sent);
    EXPECT_TRUE(run_until(io, [&] { return off.at_board.has("now"); }));
    EXPECT_EQ(off.at_host.events.size(), 1U);
  }
}

// Each host has a loop and a thread, as in r4::Board.
TEST_F(UdpTwoBoardsTest, OpenAndCloseInSeparateThreads) {
  const auto worker = [this](const char* address) {
    asio::io_context own;
    Recorder at_board, at_host;
    const auto board =
        open_carrier(own, std::string("udp://") + address + ":0", Role::board, at_board);
    const auto host =
        Registry::standard().make(own, board->name() + "?listen=" + listen, Role::host);
    int heard = 0;
    for (int i = 0; i < 100; ++i) {
      const std::string text = valid(std::to_string(i));
      host->open(at_host);
      // A datagram may be lost while a socket at its port closes or opens.
      const auto arrives = [&](Carrier& from, const Recorder& at) {
        for (int tries = 0; tries < 1000; ++tries) {
          from.send(text, Priority::normal);
          const auto heard_it = [&] { return at.has(text); };
          if (run_until(own, heard_it, std::chrono::milliseconds(5))) return true;
        }
        return false;
      };
      if (arrives(*host, at_board) && arrives(*board, at_host)) ++heard;
      host->close();
    }
    return heard;
  };
  auto first = std::async(std::launch::async, worker, "127.0.0.1");
  auto second = std::async(std::launch::async, worker, "127.0.0.2");
  EXPECT_EQ(first.get(), 100);
  EXPECT_EQ(second.get(), 100);
}

}  // namespace
}  // namespace r4::test
