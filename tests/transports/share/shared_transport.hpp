// SPDX-License-Identifier: GPL-3.0-or-later
// For tests of a shared transport: a device, and programs that share it.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <asio/post.hpp>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "../recorder.hpp"
#include "r4link/datagram.hpp"
#include "r4link/messages/datagram_writer.hpp"
#include "tests/support/carriers.hpp"
#include "transports/file_descriptor.hpp"
#include "transports/share/shared_carrier.hpp"

namespace r4::test {

// A device that only one program can open at a time, such as a serial port, or a device that
// several programs can open.
struct Device {
  class Port;
  bool exclusive = true;
  bool may_be_taken = false;  // a claim may take the device from a program that yields
  Port* open = nullptr;       // the newest port, if several programs have the device open
  int opened = 0;
  std::vector<std::string> sent;
  std::function<void()> then_sent;  // called after a datagram is sent

  void deliver(const std::string& datagram);
  void overhear(const std::string& datagram);
  void report(const CarrierEvent& event);
};

class Device::Port final : public IdleCarrier {
 public:
  Port(asio::io_context& io, Device& device, Claim claim)
      : io_(io), device_(device), claim_(std::move(claim)) {}
  ~Port() override { close(); }

  void open(Handler& handler) override {
    close();
    if (device_.exclusive && device_.open != nullptr) {
      Port* const other = device_.open;
      if (!device_.may_be_taken || !claim_->takes || !other->claim_->yields)
        throw Error(ErrorKind::open, url_, "in use", "end the other");
      asio::post(other->io_, [other] { other->lose(); });
    }
    device_.open = this;
    ++device_.opened;
    handler_ = &handler;
    handler.on_carrier_event({CarrierEvent::Kind::up, Problem{ErrorKind::open, url_, "", ""}});
  }
  void close() noexcept override {
    handler_ = nullptr;
    if (device_.open == this) device_.open = nullptr;
  }
  SendResult send(std::string_view bytes, Priority, Peer) override {
    device_.sent.emplace_back(bytes);
    if (device_.then_sent) device_.then_sent();
    return SendResult::sent;
  }
  const std::string& name() const override { return url_; }

 private:
  friend Device;

  void lose() {
    const bool was_open = handler_ != nullptr;
    close();
    if (was_open) claim_->on_taken();
  }

  asio::io_context& io_;
  Device& device_;
  const std::string url_ = "device:";
  const Claim claim_;
};

inline void Device::deliver(const std::string& datagram) {
  ASSERT_NE(open, nullptr) << "no program has the device open";
  asio::post(open->io_, [port = open, datagram] {
    if (port->handler_ == nullptr) return;
    if (datagram.size() > max_datagram) {
      port->handler_->on_oversize(std::string_view(datagram).substr(0, max_datagram));
    } else {
      port->handler_->on_datagram(datagram, everyone);
    }
  });
}

inline void Device::overhear(const std::string& datagram) {
  asio::post(open->io_, [port = open, datagram] {
    if (port->handler_ != nullptr) port->handler_->on_overheard(datagram);
  });
}

inline void Device::report(const CarrierEvent& event) {
  asio::post(open->io_, [port = open, event] {
    if (port->handler_ != nullptr) port->handler_->on_carrier_event(event);
  });
}

inline std::string datagram_of(Text name, Text value) {
  char buffer[max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  writer.field(name).values(value);
  const Text text = writer.finish(7, 1);
  return {text.data(), text.size()};
}

class SharedTransportTest : public testing::Test {
 protected:
  struct Program {
    Recorder heard;
    std::unique_ptr<Carrier> carrier;

    bool has(std::string_view text) const { return heard.has(text); }
    void open() { carrier->open(heard); }
  };

  std::unique_ptr<Program> program(BoardRole role, asio::io_context& loop) {
    auto made = std::make_unique<Program>();
    auto claim = std::make_shared<DeviceClaim>();
    made->carrier = make_shared_carrier(
        loop, std::make_unique<Device::Port>(loop, device, claim), claim, [this] { return share; },
        role);
    return made;
  }
  // A program whose open() has returned, and whose loop need not run.
  std::unique_ptr<Program> opened_in(asio::io_context& loop, BoardRole role) {
    auto made = program(role, loop);
    made->open();
    return made;
  }
  std::unique_ptr<Program> opened(BoardRole role) {
    auto made = opened_in(io, role);
    EXPECT_TRUE(run_until(io, [&] { return made->carrier->up(); }));
    return made;
  }
  // Waits for `done()`, even if this loop waits for nothing.
  template <class Done>
  [[nodiscard]] bool in_time(Done done) {
    const auto deadline = Clock::now() + patience;
    while (!done()) {
      if (Clock::now() >= deadline) return false;
      run_for(io, std::chrono::milliseconds(1));
    }
    return true;
  }
  // The device repeats `text` until all given programs have received it.
  template <class... Programs>
  bool all_hear(const std::string& text, const Programs&... programs) {
    return in_time([&] {
      if (device.open != nullptr) device.deliver(text);
      run_for(io, std::chrono::milliseconds(5));
      return (programs->has(text) && ...);
    });
  }
  // A socket of another user's program, which only root can make. With `has_name` the socket has
  // the name of the holder with the given role. Otherwise the socket is connected to this holder.
  FileDescriptor foreign_socket(BoardRole role, bool has_name) const {
    const std::string name =
        (role == BoardRole::control ? "r4link/0/control/" : "r4link/0/") + share.text;
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    name.copy(address.sun_path + 1, name.size());
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
    const auto* const bytes = reinterpret_cast<const sockaddr*>(&address);
    EXPECT_EQ(::seteuid(65534), 0);
    FileDescriptor made(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
    EXPECT_EQ(has_name ? ::bind(made.get(), bytes, size) : ::connect(made.get(), bytes, size), 0);
    if (has_name) {
      EXPECT_EQ(::listen(made.get(), 8), 0);
    }
    EXPECT_EQ(::seteuid(0), 0);
    return made;
  }
  static std::string next_name() {
    static int count;
    return fmt::format("test/{}/{}", ::getpid(), ++count);
  }

  asio::io_context io;
  Device device;
  ShareName share{next_name()};
  const std::string stop = datagram_of("E", "STOP");
};

}  // namespace r4::test
