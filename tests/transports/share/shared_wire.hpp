// SPDX-License-Identifier: GPL-3.0-or-later
// What the tests of a shared wire have in common: a device, and programs that share it.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <asio/executor_work_guard.hpp>
#include <asio/post.hpp>
#include <atomic>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "../recorder.hpp"
#include "protocol/datagram/datagram_writer.hpp"
#include "r4link/datagram.hpp"
#include "transports/share/shared_carrier.hpp"

namespace r4::test {

// A device that one can have open at a time, as a serial port is, or several.
struct Device {
  class Wire;
  std::mutex mutex;
  bool exclusive = true;
  bool may_be_taken = false;  // from one that yields
  Wire* open = nullptr;       // the newest, if it is for several
  int opened = 0;
  std::vector<std::string> sent;
  std::function<void()> then_sent;    // also called
  std::function<void()> before_open;  // called by the next that opens it

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
  Wire(asio::io_context& io, Device& device, std::shared_ptr<DeviceClaim> claim)
      : io_(io), device_(device), claim_(std::move(claim)) {}
  ~Wire() override { close(); }

  void open(Handler& handler) override {
    close();
    if (const auto before = std::exchange(device_.before_open, {})) before();
    {
      const std::lock_guard lock(device_.mutex);
      if (device_.exclusive && device_.open != nullptr) {
        Wire* const other = device_.open;
        if (!device_.may_be_taken || !claim_->takes || !other->claim_->yields)
          throw Error(ErrorKind::open, name_, "in use", "end the other");
        asio::post(other->io_, [other] { other->lose(); });
      }
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
    if (device_.then_sent) device_.then_sent();
    return SendResult::sent;
  }
  bool up() const override { return up_; }
  const std::string& name() const override { return name_; }
  const CarrierCounters& counters() const override { return counters_; }

 private:
  friend Device;

  void lose() {
    const bool was_open = handler_ != nullptr;
    close();
    if (was_open) claim_->on_taken();
  }

  asio::io_context& io_;
  Device& device_;
  const std::string name_ = "device:";
  Handler* handler_ = nullptr;
  bool up_ = false;
  const std::shared_ptr<DeviceClaim> claim_;
  CarrierCounters counters_;
};

inline void Device::deliver(const std::string& datagram) {
  const std::lock_guard lock(mutex);
  ASSERT_NE(open, nullptr) << "nobody has it open";
  asio::post(open->io_, [wire = open, datagram] {
    if (wire->handler_ == nullptr) return;
    if (datagram.size() > max_datagram) {
      wire->handler_->on_oversize(std::string_view(datagram).substr(0, max_datagram));
    } else {
      wire->handler_->on_datagram(datagram, everyone);
    }
  });
}

inline void Device::overhear(const std::string& datagram) {
  const std::lock_guard lock(mutex);
  asio::post(open->io_, [wire = open, datagram] {
    if (wire->handler_ != nullptr) wire->handler_->on_overheard(datagram);
  });
}

inline void Device::report(const CarrierEvent& event) {
  const std::lock_guard lock(mutex);
  asio::post(open->io_, [wire = open, event] {
    if (wire->handler_ != nullptr) wire->handler_->on_carrier_event(event);
  });
}

inline std::string datagram_of(Text name, Text value) {
  char buffer[max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  writer.field(name).values(value);
  const Text text = writer.finish(7, 1);
  return {text.data(), text.size()};
}

class SharedWireTest : public testing::Test {
 protected:
  // A program: here, in this loop, or in a thread of its own.
  struct Program {
    Recorder heard;
    std::unique_ptr<Carrier> carrier;

    bool has(std::string_view text) const { return heard.has(text); }
  };

  std::unique_ptr<Program> program(BoardRole role, asio::io_context& loop) {
    return program(role, loop, wire);
  }
  std::unique_ptr<Program> program(BoardRole role, asio::io_context& loop,
                                   const std::string& name) {
    auto made = std::make_unique<Program>();
    auto claim = std::make_shared<DeviceClaim>();
    made->carrier = make_shared_carrier(
        loop, std::make_unique<Device::Wire>(loop, device, claim), claim,
        [this, name] {
          return SharedWire{name, group};
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
      run_for(io, std::chrono::milliseconds(1));
      std::this_thread::yield();  // others have loops of their own
    }
    return true;
  }
  static int next() {
    static std::atomic<int> count;
    return ++count;
  }

  asio::io_context io;
  Device device;
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

}  // namespace r4::test
