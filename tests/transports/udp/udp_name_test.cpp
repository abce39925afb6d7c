// SPDX-License-Identifier: GPL-3.0-or-later
// A board with a host name: how a UDP carrier looks up the address, and repeats the lookup.
#include <gtest/gtest.h>

#include <asio/post.hpp>
#include <condition_variable>
#include <mutex>

#include "../recorder.hpp"
#include "tests/support/datagrams.hpp"
#include "tests/support/problems.hpp"
#include "transports/udp/udp_host.hpp"

namespace r4::test {
namespace {

using std::chrono::milliseconds;

// A name server for the test. The thread of a lookup may outlive the test.
class Names {
 public:
  // Sets the address of the host; "": no address.
  void set(const std::string& address) {
    const std::lock_guard lock(shared_->mutex);
    shared_->found = FoundHost();
    if (address.empty()) {
      shared_->found.reason = "not known";
    } else {
      shared_->found.addresses = {asio::ip::make_address(address)};
    }
  }
  // While `on`, lookups get no answer.
  void hang(bool on) {
    const std::lock_guard lock(shared_->mutex);
    shared_->hangs = on;
    shared_->changed.notify_all();
  }
  int asked() const {
    const std::lock_guard lock(shared_->mutex);
    return shared_->asked;
  }
  HostLookup::Resolve resolve() const {
    return [shared = shared_](const std::string&) {
      std::unique_lock lock(shared->mutex);
      ++shared->asked;
      shared->changed.wait(lock, [&] { return !shared->hangs; });
      return shared->found;
    };
  }
  ~Names() { hang(false); }

 private:
  struct Shared {
    std::mutex mutex;
    std::condition_variable changed;
    FoundHost found;
    bool hangs = false;
    int asked = 0;
  };
  std::shared_ptr<Shared> shared_ = std::make_shared<Shared>();
};

std::string valid_answer(const std::string& name) { return with_crc(name + ":;"); }

class UdpNameTest : public testing::Test {
 protected:
  UdpNameTest() {
    names.set("127.0.0.1");
    lookup.resolve = names.resolve();
    lookup.retry = lookup.silence = milliseconds(10);
    board = open_carrier(io, "udp://127.0.0.1:0", Role::board, at_board);
    port = board->name().substr(board->name().rfind(':') + 1);
  }
  std::unique_ptr<Carrier> make(asio::io_context& loop) {
    const Url url = Url::parse("udp://board.test:" + port + "?listen=0");
    return std::make_unique<UdpHost>(loop, url, std::make_shared<DeviceClaim>(), lookup);
  }
  void open_in_loop() {
    host = make(io);
    asio::post(io, [this] { host->open(at_host); });
  }
  void expect_link() {
    const std::string text = valid_answer("question" + std::to_string(++questions));
    host->send(text, Priority::normal);
    EXPECT_TRUE(run_until(io, [&] { return at_board.has(text); }));
  }

  asio::io_context io;
  Names names;
  HostLookup lookup;
  Recorder at_board, at_host;
  std::string port;
  std::unique_ptr<Carrier> board, host;
  int questions = 0;
};

TEST_F(UdpNameTest, OpenFailsIfTheNameServerDoesNotAnswerInTime) {
  names.hang(true);
  lookup.patience = milliseconds(20);
  host = make(io);
  const auto begun = Clock::now();
  const Problem problem = problem_of([&] { host->open(at_host); });
  EXPECT_LT(Clock::now() - begun, patience);
  EXPECT_EQ(problem.kind, ErrorKind::open);
  EXPECT_TRUE(contains(problem.reason, "the name server does not answer"));
  EXPECT_FALSE(problem.fix.empty());
}

TEST_F(UdpNameTest, DoesNotBlockTheLoop) {
  names.hang(true);
  open_in_loop();
  Recorder at_other;
  const auto other = open_carrier(io, board->name() + "?listen=0", Role::host, at_other);
  other->send(valid_answer("meanwhile"), Priority::normal);
  ASSERT_TRUE(
      run_until(io, [&] { return at_board.has(valid_answer("meanwhile")) && names.asked() == 1; }));
  EXPECT_FALSE(host->up());
  EXPECT_TRUE(at_host.events.empty());
  EXPECT_EQ(host->send("too early", Priority::normal), SendResult::down);
  names.hang(false);
  ASSERT_TRUE(run_until(io, [&] { return host->up(); }));
  EXPECT_EQ(at_host.count(Kind::up), 1U);
  EXPECT_EQ(at_host.count(Kind::down), 0U);
  expect_link();
}

TEST_F(UdpNameTest, KeepsItsAddressIfTheNameDisappears) {
  host = make(io);
  host->open(at_host);
  EXPECT_EQ(host->name().find("udp://board.test:" + port), 0U);
  names.set("");
  const int before = names.asked();
  ASSERT_TRUE(run_until(io, [&] { return names.asked() > before + 2; }));
  EXPECT_TRUE(host->up());
  EXPECT_EQ(at_host.events.size(), 1U);
  expect_link();
}

TEST_F(UdpNameTest, IsNotLookedUpAgainWhileTheBoardIsHeard) {
  lookup.silence = milliseconds(50);
  host = make(io);
  host->open(at_host);
  host->send(valid_answer("hello"), Priority::normal);
  ASSERT_TRUE(run_until(io, [&] { return at_board.has(valid_answer("hello")); }));
  // Only valid datagrams postpone the next lookup.
  const auto speak = [&](const std::string& text, int times) {
    for (int i = 0; i < times; ++i) {
      board->send(text, Priority::normal);
      run_for(io, milliseconds(5));
    }
  };
  speak(valid_answer("state"), 60);
  EXPECT_EQ(names.asked(), 1);
  speak("noise", 60);
  EXPECT_GE(names.asked(), 2);
}

TEST_F(UdpNameTest, CloseCancelsTheLookup) {
  names.hang(true);
  open_in_loop();
  ASSERT_TRUE(run_until(io, [&] { return names.asked() == 1; }));
  host->close();
  names.hang(false);
  run_for(io, milliseconds(20));
  EXPECT_TRUE(at_host.events.empty());
  EXPECT_EQ(names.asked(), 1);
  open_in_loop();
  EXPECT_TRUE(run_until(io, [&] { return host->up(); }));
}

TEST_F(UdpNameTest, AnAnswerAfterTheLoopIsDestroyedIsHarmless) {
  names.hang(true);
  {
    asio::io_context own;
    const auto carrier = make(own);
    asio::post(own, [&] { carrier->open(at_host); });
    ASSERT_TRUE(run_until(own, [&] { return names.asked() == 1; }));
  }
  names.hang(false);
}

TEST_F(UdpNameTest, ResolvesLocalhost) {
  host = open_carrier(io, "udp://localhost:" + port + "?listen=0", Role::host, at_host);
  expect_link();
}

}  // namespace
}  // namespace r4::test
