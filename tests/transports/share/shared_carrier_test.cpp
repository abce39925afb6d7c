// SPDX-License-Identifier: GPL-3.0-or-later
#include "transports/share/shared_carrier.hpp"

#include <fmt/core.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <asio/executor_work_guard.hpp>
#include <asio/post.hpp>
#include <atomic>
#include <cerrno>
#include <cstddef>
#include <future>
#include <mutex>
#include <set>
#include <thread>
#include <utility>

#include "../recorder.hpp"
#include "protocol/datagram/datagram_writer.hpp"
#include "transports/share/share_message.hpp"
#include "transports/share/share_socket.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

// A device that one can have open at a time, as a serial port is.
struct Device {
  class Wire;
  std::mutex mutex;
  Wire* open = nullptr;
  int opened = 0;
  std::vector<std::string> sent;

  std::vector<std::string> all_sent() {
    const std::lock_guard lock(mutex);
    return sent;
  }
  void deliver(const std::string& datagram);
  void overhear(const std::string& datagram);
  void report(const CarrierEvent& event);
};

class Device::Wire final : public Carrier {
 public:
  Wire(asio::io_context& io, Device& device) : io_(io), device_(device) {}
  ~Wire() override { close(); }

  void open(Handler& handler) override {
    close();
    {
      const std::lock_guard lock(device_.mutex);
      if (device_.open != nullptr) throw Error(ErrorKind::open, name_, "in use", "end the other");
      device_.open = this;
      ++device_.opened;
    }
    handler_ = &handler;
    up_ = true;
    handler.on_carrier_event({CarrierEvent::Kind::up, Problem{ErrorKind::open, name_, "", ""}});
  }
  void close() noexcept override {
    handler_ = nullptr;
    up_ = false;
    const std::lock_guard lock(device_.mutex);
    if (device_.open == this) device_.open = nullptr;
  }
  SendResult send(std::string_view bytes, Priority, Peer) override {
    const std::lock_guard lock(device_.mutex);
    device_.sent.emplace_back(bytes);
    return SendResult::sent;
  }
  bool up() const override { return up_; }
  std::size_t max_size() const override { return max_datagram; }
  const std::string& name() const override { return name_; }
  const CarrierCounters& counters() const override { return counters_; }

 private:
  friend Device;

  asio::io_context& io_;
  Device& device_;
  const std::string name_ = "device:";
  Handler* handler_ = nullptr;
  bool up_ = false;
  CarrierCounters counters_;
};

void Device::deliver(const std::string& datagram) {
  const std::lock_guard lock(mutex);
  ASSERT_NE(open, nullptr) << "nobody has it open";
  asio::post(open->io_, [this, wire = open, datagram] {
    if (wire->handler_ == nullptr) return;
    if (datagram.size() > max_datagram) {
      wire->handler_->on_oversize(std::string_view(datagram).substr(0, max_datagram));
    } else {
      wire->handler_->on_datagram(datagram, everyone);
    }
  });
}

void Device::overhear(const std::string& datagram) {
  const std::lock_guard lock(mutex);
  asio::post(open->io_, [wire = open, datagram] {
    if (wire->handler_ != nullptr) wire->handler_->on_overheard(datagram);
  });
}

void Device::report(const CarrierEvent& event) {
  const std::lock_guard lock(mutex);
  asio::post(open->io_, [wire = open, event] {
    if (wire->handler_ != nullptr) wire->handler_->on_carrier_event(event);
  });
}

std::string datagram_of(Text name, Text value) {
  char buffer[max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  writer.field(name).value(value);
  const Text text = writer.finish(7, 1);
  return {text.data(), text.size()};
}

class SharedCarrier : public testing::Test {
 protected:
  // A program: here, in this loop, or in a thread of its own.
  struct Program {
    Recorder heard;
    std::unique_ptr<Carrier> carrier;

    bool has(std::string_view text) const { return heard.has(text); }
  };

  std::unique_ptr<Program> program(BoardRole role, asio::io_context& loop) {
    auto made = std::make_unique<Program>();
    made->carrier = make_shared_carrier(
        loop, std::make_unique<Device::Wire>(loop, device),
        [this] {
          return SharedWire{wire, exclusive, group};
        },
        role);
    return made;
  }
  std::unique_ptr<Program> opened(BoardRole role) {
    auto made = program(role, io);
    made->carrier->open(made->heard);
    EXPECT_TRUE(run_until(io, [&] { return made->carrier->up(); }));
    return made;
  }
  // Goes on until `done()`, also while this loop has nothing to wait for.
  template <class Done>
  bool in_time(Done done) {
    const auto deadline = Clock::now() + patience;
    while (!done()) {
      if (Clock::now() >= deadline) return false;
      run_for(io, 1ms);
      std::this_thread::yield();  // others have loops of their own
    }
    return true;
  }
  // A connection of no carrier: what a forger has.
  FileDescriptor raw() {
    FileDescriptor connection = reach_holder({wire});
    EXPECT_TRUE(connection);
    return connection;
  }
  // Reads on until the holder ends the connection.
  bool is_cut_off(const FileDescriptor& connection) {
    return in_time([&] {
      std::array<char, 2048> bytes;
      while (true) {
        const ssize_t size = receive_packet(connection.get(), bytes.data(), bytes.size());
        if (size < 0 && errno == EAGAIN) break;
        if (size <= 0) return true;
      }
      return false;
    });
  }

  static int next() {
    static std::atomic<int> count;
    return ++count;
  }

  asio::io_context io;
  Device device;
  bool exclusive = true;
  ShareGroup group;  // none
  const std::string wire = fmt::format("test/{}/{}", ::getpid(), next());
};

// A loop in a thread of its own, for one that is asked while this thread waits for its answer.
class OtherThread {
 public:
  OtherThread() : work_(loop.get_executor()), thread_([this] { loop.run(); }) {}
  ~OtherThread() {
    work_.reset();
    loop.stop();
    thread_.join();
  }
  // Runs there, to its end.
  template <class Function>
  void run(Function function) {
    std::promise<void> done;
    asio::post(loop, [&] {
      function();
      done.set_value();
    });
    done.get_future().wait();
  }

  asio::io_context loop;

 private:
  asio::executor_work_guard<asio::io_context::executor_type> work_;
  std::thread thread_;
};

TEST_F(SharedCarrier, WhoComesFirstHasTheWire) {
  const auto only = opened(BoardRole::control);
  EXPECT_EQ(device.opened, 1);
  EXPECT_EQ(only->carrier->name(), "device:");
  EXPECT_EQ(only->carrier->send("hello", Priority::normal), SendResult::sent);
  EXPECT_EQ(device.all_sent(), std::vector<std::string>{"hello"});
  device.deliver("answer");
  EXPECT_TRUE(run_until(io, [&] { return only->has("answer"); }));
  only->carrier->close();
  EXPECT_EQ(device.open, nullptr);
  EXPECT_FALSE(reach_holder({wire}));
}

TEST_F(SharedCarrier, ThoseThatWatchHearBothDirections) {
  const auto driver = opened(BoardRole::control);
  const auto one = opened(BoardRole::watch);
  const auto two = opened(BoardRole::watch);
  EXPECT_EQ(device.opened, 1);
  EXPECT_EQ(one->carrier->name(), "device:");
  for (int i = 0; i < 100; ++i) {
    device.deliver(fmt::format("AIN24:{};", i));
    device.deliver(fmt::format("H:R4-ROS2;{};", i));
    driver->carrier->send(fmt::format("H:ROS2-R4;{};", i), Priority::normal);
    run_until(io, [&] { return two->has(fmt::format("H:R4-ROS2;{};", i)); });
  }
  for (const auto& each : {one.get(), two.get()}) {
    ASSERT_TRUE(run_until(io, [&] { return each->heard.overheard.size() == 100; }));
    EXPECT_EQ(each->heard.datagrams.size(), 200U);
    EXPECT_EQ(each->heard.overheard.back(), "H:ROS2-R4;99;");
    EXPECT_EQ(each->carrier->counters().rx_datagrams, 200U);
    EXPECT_GT(each->heard.drained, 0);
  }
  EXPECT_TRUE(driver->heard.overheard.empty());
}

TEST_F(SharedCarrier, AllHearWhatAnotherHostSaysOnTheWireAndWhatIsTooLong) {
  const auto driver = opened(BoardRole::control);
  const auto watcher = opened(BoardRole::watch);
  device.overhear("O:358,1,1;");
  device.deliver(std::string(2000, 'x'));
  device.deliver("last");
  ASSERT_TRUE(run_until(io, [&] { return watcher->has("last"); }));
  for (const auto& each : {driver.get(), watcher.get()}) {
    EXPECT_EQ(each->heard.overheard, std::vector<std::string>{"O:358,1,1;"});
    EXPECT_EQ(each->heard.oversize, std::vector<std::string>{std::string(max_datagram, 'x')});
  }
  EXPECT_EQ(watcher->carrier->counters().rx_oversize, 1U);
}

TEST_F(SharedCarrier, WhoWatchesStopsTheBoardAndSaysNothingElse) {
  const auto driver = opened(BoardRole::control);
  const auto watcher = opened(BoardRole::watch);
  EXPECT_TRUE(watcher->carrier->is_shared());
  EXPECT_FALSE(driver->carrier->is_shared());
  watcher->carrier->send(datagram_of("H", "ROS2-R4"), Priority::normal);
  const std::string stop = datagram_of("E", "STOP");
  EXPECT_EQ(watcher->carrier->send(stop, Priority::stop), SendResult::sent);
  ASSERT_TRUE(run_until(io, [&] { return !device.all_sent().empty(); }));
  EXPECT_EQ(device.all_sent(), std::vector<std::string>{stop});
  EXPECT_EQ(driver->heard.overheard, std::vector<std::string>{stop});
}

TEST_F(SharedCarrier, AStopNeedsNoWelcome) {
  const auto driver = opened(BoardRole::control);
  const auto watcher = program(BoardRole::watch, io);
  watcher->carrier->open(watcher->heard);
  const std::string stop = datagram_of("E", "STOP");
  EXPECT_EQ(watcher->carrier->send(stop, Priority::stop), SendResult::sent);
  watcher->carrier->close();
  EXPECT_TRUE(run_until(io, [&] { return !device.all_sent().empty(); }));
}

TEST_F(SharedCarrier, AThirdIsToldWhoControls) {
  OtherThread elsewhere;
  std::unique_ptr<Program> driver;
  elsewhere.run([&] {
    driver = program(BoardRole::control, elsewhere.loop);
    driver->carrier->open(driver->heard);
  });
  const auto second = program(BoardRole::control, io);
  const auto error = error_of([&] { second->carrier->open(second->heard); });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->kind(), ErrorKind::refused);
  EXPECT_EQ(error->problem().reason,
            fmt::format("controlled by {} (pid {})", program_invocation_short_name, ::getpid()));
  EXPECT_FALSE(second->carrier->up());
  EXPECT_EQ(device.opened, 1);
  elsewhere.run([&] { driver.reset(); });
  second->carrier->open(second->heard);
  EXPECT_TRUE(second->carrier->up());
}

TEST_F(SharedCarrier, WhoWatchesGivesTheWireToWhoControls) {
  OtherThread elsewhere;
  std::array<std::unique_ptr<Program>, 3> watchers;
  elsewhere.run([&] {
    for (auto& each : watchers) {
      each = program(BoardRole::watch, elsewhere.loop);
      each->carrier->open(each->heard);
    }
  });
  EXPECT_EQ(device.opened, 1);
  const auto driver = program(BoardRole::control, io);
  driver->carrier->open(driver->heard);
  EXPECT_TRUE(driver->carrier->up());
  driver->carrier->send("O:358,1,1;", Priority::normal);
  const auto all_hear = [&](const std::string& text) {
    return in_time([&] {
      device.deliver(text);
      run_for(io, 5ms);
      bool all = true;
      elsewhere.run([&] {
        for (const auto& each : watchers) all = all && each->has(text);
      });
      return all;
    });
  };
  EXPECT_TRUE(all_hear("driven"));
  driver->carrier->close();
  ASSERT_TRUE(in_time([&] {
    const std::lock_guard lock(device.mutex);
    return device.open != nullptr;
  }));
  EXPECT_TRUE(all_hear("nobody drives"));
  elsewhere.run([&] {
    for (auto& each : watchers) {
      EXPECT_EQ(each->heard.count(Kind::down), 0U);
      each.reset();
    }
  });
}

TEST_F(SharedCarrier, AnotherTakesTheWireOverFromOneThatEnds) {
  std::vector<std::unique_ptr<Program>> programs;
  for (int i = 0; i < 5; ++i) programs.push_back(opened(BoardRole::watch));
  while (programs.size() > 1) {
    programs.erase(programs.begin());
    const auto ended = Clock::now();
    // Whoever has it now.
    ASSERT_TRUE(run_until(io, [&] { return device.open != nullptr; }));
    EXPECT_LT(in_milliseconds(Clock::now() - ended), 100);
    const std::string text = fmt::format("{} left", programs.size());
    ASSERT_TRUE(in_time([&] {
      device.deliver(text);
      run_for(io, 5ms);
      bool all = true;
      for (const auto& each : programs) all = all && each->has(text);
      return all;
    }));
  }
  EXPECT_EQ(device.opened, 5);
  EXPECT_EQ(programs.front()->heard.count(Kind::down), 0U);
}

TEST_F(SharedCarrier, TroubleOfTheWireIsToldToAll) {
  const auto holder = opened(BoardRole::watch);
  const auto early = opened(BoardRole::watch);
  const Problem unplugged{ErrorKind::open, "device:", "unplugged", "plug it in again"};
  device.report({CarrierEvent::Kind::down, unplugged});
  ASSERT_TRUE(run_until(io, [&] { return early->heard.count(Kind::down) == 1; }));
  EXPECT_EQ(early->heard.last(Kind::down)->problem.text(), unplugged.text());
  EXPECT_FALSE(early->carrier->up());
  const auto late = program(BoardRole::watch, io);
  late->carrier->open(late->heard);
  ASSERT_TRUE(run_until(io, [&] { return late->heard.count(Kind::down) == 1; }));
  device.report({CarrierEvent::Kind::up, Problem{ErrorKind::open, "device:", "", ""}});
  ASSERT_TRUE(run_until(io, [&] { return late->carrier->up() && early->carrier->up(); }));
}

TEST_F(SharedCarrier, AHolderThatDoesNotAnswerIsNamed) {
  asio::io_context stopped;  // nobody runs it
  const auto holder = program(BoardRole::watch, stopped);
  holder->carrier->open(holder->heard);
  const std::string who = "this program has it open already";

  const auto driver = program(BoardRole::control, io);
  const auto error = error_of([&] { driver->carrier->open(driver->heard); });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->problem().reason, who);

  const auto watcher = program(BoardRole::watch, io);
  const auto began = Clock::now();
  watcher->carrier->open(watcher->heard);
  EXPECT_LT(in_milliseconds(Clock::now() - began), 100) << "it blocks the loop";
  ASSERT_TRUE(run_until(io, [&] { return watcher->heard.count(Kind::down) == 1; }));
  EXPECT_EQ(watcher->heard.last(Kind::down)->problem.reason, who);
  // It goes on.
  ASSERT_TRUE(in_time([&] {
    run_for(stopped, 5ms);
    return watcher->carrier->up();
  }));
  EXPECT_EQ(watcher->heard.count(Kind::down), 1U);
}

TEST_F(SharedCarrier, OneThatSleepsIsLetGoAndComesBack) {
  const auto holder = opened(BoardRole::control);
  asio::io_context asleep;
  const auto sleeper = program(BoardRole::watch, asleep);
  sleeper->carrier->open(sleeper->heard);
  in_time([&] {
    run_for(asleep, 1ms);
    return sleeper->carrier->up();
  });
  const FileDescriptor raw_sleeper = raw();
  ASSERT_EQ(send_message(raw_sleeper.get(), ShareMessage::Kind::hello,
                         hello_text(BoardRole::watch, "sleeper")),
            0);
  const auto awake = opened(BoardRole::watch);
  int sent = 0;
  const auto until = Clock::now() + 1500ms;
  while (Clock::now() < until) {
    device.deliver(fmt::format("state {};{}", ++sent, std::string(160, 'x')));
    run_for(io, 2ms);
  }
  EXPECT_EQ(awake->heard.datagrams.size(), static_cast<std::size_t>(sent));
  // What waits in the kernel, and then the end.
  std::array<char, 2048> bytes;
  int old = 0;
  ssize_t last = 0;
  while ((last = receive_packet(raw_sleeper.get(), bytes.data(), bytes.size())) > 0) ++old;
  EXPECT_LT(old, 200);
  EXPECT_EQ(last, 0) << "still there";
  ASSERT_TRUE(in_time([&] {
    device.deliver("again");
    run_for(asleep, 5ms);
    return sleeper->has("again");
  }));
}

TEST_F(SharedCarrier, WhoSaysWhatNoProgramOfOursDoesIsCutOff) {
  const auto holder = opened(BoardRole::control);
  const std::string hello = hello_text(BoardRole::watch, "forger");
  using Message = std::pair<ShareMessage::Kind, std::string>;
  for (const auto& [kind, text] : {
           Message{ShareMessage::Kind::received, "SAFE:0;"},
           Message{ShareMessage::Kind::sent, "O:358,1,1;"},
           Message{ShareMessage::Kind::stop, "no datagram"},
           Message{ShareMessage::Kind::stop, datagram_of("O", "358,1,1")},
           Message{ShareMessage::Kind::stop, datagram_of("E", "CLEAR")},
           Message{ShareMessage::Kind::yours, ""},
           Message{ShareMessage::Kind::up, "device:"},
           Message{static_cast<ShareMessage::Kind>('?'), "?"},
           Message{ShareMessage::Kind::stop, std::string(3000, 'x')},
           Message{ShareMessage::Kind::hello, "2"},
       }) {
    const FileDescriptor connection = raw();
    ASSERT_EQ(send_message(connection.get(), kind, text), 0);
    EXPECT_TRUE(is_cut_off(connection)) << static_cast<char>(kind) << text.substr(0, 20);
  }
  const FileDescriptor twice = raw();
  send_message(twice.get(), ShareMessage::Kind::hello, hello);
  send_message(twice.get(), ShareMessage::Kind::hello, hello);
  EXPECT_TRUE(is_cut_off(twice));
  EXPECT_TRUE(device.all_sent().empty());
  EXPECT_TRUE(holder->heard.datagrams.empty());
  EXPECT_TRUE(holder->carrier->up());
}

TEST_F(SharedCarrier, AFloodOfStopsEndsAtAHundredASecond) {
  const auto holder = opened(BoardRole::control);
  const FileDescriptor connection = raw();
  const std::string stop = datagram_of("E", "STOP");
  in_time([&] {
    const int error = send_message(connection.get(), ShareMessage::Kind::stop, stop);
    return error != 0 && error != EAGAIN;
  });
  EXPECT_GE(device.all_sent().size(), 1U);
  EXPECT_LE(device.all_sent().size(), 202U);
}

TEST_F(SharedCarrier, TheLastWordOfOneThatSaysTooMuchMayBeAStop) {
  const auto holder = opened(BoardRole::control);
  const FileDescriptor connection = raw();
  const auto say = [&](ShareMessage::Kind kind, std::string_view text) {
    return in_time([&] { return send_message(connection.get(), kind, text) == 0; });
  };
  ASSERT_TRUE(say(ShareMessage::Kind::hello, hello_text(BoardRole::watch, "chatterbox")));
  const std::string stop = datagram_of("E", "STOP");
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(say(ShareMessage::Kind::stop, stop));
  EXPECT_TRUE(is_cut_off(connection));
  EXPECT_EQ(device.all_sent().size(), 100U);
}

TEST_F(SharedCarrier, SixteenMayShareIt) {
  const auto holder = opened(BoardRole::control);
  std::vector<FileDescriptor> sharers;
  for (int i = 0; i < 16; ++i) sharers.push_back(raw());
  run_for(io, 20ms);
  const FileDescriptor one_too_many = raw();
  EXPECT_TRUE(is_cut_off(one_too_many));
  sharers.pop_back();
  run_for(io, 20ms);
  const auto next_one = opened(BoardRole::watch);
  device.deliver("state");
  EXPECT_TRUE(run_until(io, [&] { return next_one->has("state"); }));
}

TEST_F(SharedCarrier, IsNotForOtherUsers) {
  const auto holder = opened(BoardRole::control);
  const int result = run_unprivileged([&] { return reach_holder({wire}) ? 1 : 0; });
  EXPECT_EQ(result, 0);
}

TEST_F(SharedCarrier, IsForTheMembersOfTheGroupThatTheHolderNames) {
  const std::string stop = datagram_of("E", "STOP");
  // A user in the group nobody has (65534), and in no other.
  const auto stop_it = [&](const ShareGroup& of) {
    return run_unprivileged([&] {
      const SharedWire shared{wire, exclusive, of};
      const FileDescriptor connection = reach_holder(shared);
      if (!connection || !is_one_of_us(connection.get(), shared)) return 1;
      return send_message(connection.get(), ShareMessage::Kind::stop, stop);
    });
  };
  group = {"members", 65534};
  const auto holder = opened(BoardRole::control);
  EXPECT_NE(stop_it({"others", 65534}), 0) << "another name";
  EXPECT_EQ(stop_it(group), 0);
  EXPECT_TRUE(run_until(io, [&] { return !device.all_sent().empty(); }));
  EXPECT_EQ(device.all_sent(), std::vector<std::string>{stop});
  holder->carrier->close();
  group.id = 0;
  const auto strict = opened(BoardRole::control);
  stop_it(group);
  run_for(io, 20ms);
  EXPECT_EQ(device.all_sent().size(), 1U);
}

// Anyone may take a name: it must keep nobody from a wire, and be told.
TEST_F(SharedCarrier, AStrangerWhoTakesTheNameKeepsNobodyFromTheWire) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can be a stranger, too";
  const std::string name = fmt::format("r4link/0/{}", wire);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  name.copy(address.sun_path + 1, name.size());
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
  ASSERT_EQ(::seteuid(65534), 0);
  const FileDescriptor squatter(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
  ::bind(squatter.get(), reinterpret_cast<const sockaddr*>(&address), size);
  const int listening = ::listen(squatter.get(), 1);
  ASSERT_EQ(::seteuid(0), 0);
  ASSERT_EQ(listening, 0);
  const auto driver = opened(BoardRole::control);
  EXPECT_EQ(driver->carrier->send("hello", Priority::normal), SendResult::sent);
  EXPECT_EQ(device.all_sent(), std::vector<std::string>{"hello"});
  const auto& warning = driver->heard.events.back();
  EXPECT_EQ(warning.kind, CarrierEvent::Kind::warning);
  EXPECT_EQ(warning.problem.kind, ErrorKind::permission);
  EXPECT_EQ(
      warning.problem.reason,
      fmt::format("user 65534 (pid {}) has taken the name by which programs of user 0 share it",
                  ::getpid()));
}

}  // namespace
}  // namespace r4::test
