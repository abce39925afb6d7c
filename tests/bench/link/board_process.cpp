// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_process.hpp"

#include <fcntl.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <asio/executor_work_guard.hpp>
#include <asio/io_context.hpp>
#include <asio/posix/stream_descriptor.hpp>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <stdexcept>

#include "firmware/ports/sim/simulated_board.hpp"
#include "tests/bench/allocations.hpp"
#include "transports/registry.hpp"

namespace r4::bench {

namespace {

void make_raw(int fd) {
  termios settings;
  require(::tcgetattr(fd, &settings) == 0, "tcgetattr");
  ::cfmakeraw(&settings);
  require(::tcsetattr(fd, TCSANOW, &settings) == 0, "tcsetattr");
}

// Reads until the end of a line.
bool read_line(int fd) {
  char buffer[512];
  for (;;) {
    const ssize_t got = ::read(fd, buffer, sizeof buffer);
    if (got <= 0) return false;
    if (buffer[got - 1] == '\n') return true;
  }
}

}  // namespace

const char* to_text(Transport path) { return path == Transport::udp ? "udp" : "pty"; }

Usage own_usage() {
  rusage used;
  ::getrusage(RUSAGE_SELF, &used);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_usec) * 1e-6;
  };
  return {seconds(used.ru_utime) + seconds(used.ru_stime), allocations(), 0};
}

// --- the board

BoardProcess::BoardProcess(Transport path, bool unbound) {
  if (fork_child()) serve(path, unbound);
  std::array<char, 256> text{};
  read_all(control_, text.data(), text.size());
  url_ = text.data();
}

Usage BoardProcess::usage() const {
  write_all(control_, "u", 1);
  Usage usage;
  read_all(control_, &usage, sizeof usage);
  return usage;
}

void BoardProcess::serve(Transport path, bool unbound) {
  asio::io_context io{ASIO_CONCURRENCY_HINT_UNSAFE};
  std::uint32_t virtual_ms = 0;
  sim::SimulatedBoard::Options options;
  if (unbound) {
    options.clock_ms = [&] { return virtual_ms; };
    options.settings.timeout_ms = 10000;  // the clock runs a hundred times too fast
    options.settings.heartbeat_ms = 500;
    options.settings.state_rate_hz = 1000;
  }
  sim::SimulatedBoard board(io, std::move(options));
  auto carrier = Registry::standard().make(
      io, path == Transport::udp ? "udp://127.0.0.1:0" : "pty:", Role::board);
  const Carrier& end = *carrier;
  board.add_carrier(std::move(carrier));
  board.start();
  std::array<char, 256> text{};
  const std::string& name = end.name();
  const std::string url =
      path == Transport::udp ? name + "?listen=0" : "serial://" + name.substr(name.find(':') + 1);
  std::memcpy(text.data(), url.data(), url.size());
  write_all(control_, text.data(), text.size());

  asio::posix::stream_descriptor control(io, control_);
  char question = 0;
  std::function<void()> listen = [&] {
    control.async_read_some(asio::buffer(&question, 1),
                            [&](const std::error_code& error, std::size_t) {
                              if (error) end_child();
                              Usage usage = own_usage();
                              usage.sent = end.counters().tx_datagrams;
                              write_all(control_, &usage, sizeof usage);
                              listen();
                            });
  };
  listen();
  if (!unbound) {
    io.run();
  } else {
    for (;;) {
      for (int i = 0; i < 8; ++i) {
        ++virtual_ms;
        board.poll();
      }
      io.poll();
    }
  }
  end_child();
}

// --- the plain program

EchoProcess::EchoProcess(Transport path, std::size_t question_size, std::size_t answer_size)
    : path_(path), question_(question_size, 'q'), answer_(answer_size, 'a') {
  if (path == Transport::udp) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    sockaddr_in other = address;
    ours_ = ::socket(AF_INET, SOCK_DGRAM, 0);
    theirs_ = ::socket(AF_INET, SOCK_DGRAM, 0);
    for (const auto& [fd, at] : {std::pair(ours_, &address), std::pair(theirs_, &other)}) {
      require(::bind(fd, reinterpret_cast<sockaddr*>(at), size) == 0, "bind");
      ::getsockname(fd, reinterpret_cast<sockaddr*>(at), &size);
    }
    require(::connect(ours_, reinterpret_cast<sockaddr*>(&other), size) == 0, "connect");
    require(::connect(theirs_, reinterpret_cast<sockaddr*>(&address), size) == 0, "connect");
  } else {
    question_.back() = answer_.back() = '\n';
    theirs_ = ::posix_openpt(O_RDWR | O_NOCTTY);
    require(theirs_ >= 0 && ::grantpt(theirs_) == 0 && ::unlockpt(theirs_) == 0, "openpt");
    ours_ = ::open(::ptsname(theirs_), O_RDWR | O_NOCTTY);
    require(ours_ >= 0, "open");
    make_raw(ours_);
  }
  if (fork_child()) serve();
}

void EchoProcess::serve() {
  std::array<char, 2048> buffer;
  for (;;) {
    if (path_ == Transport::udp) {
      if (::recv(theirs_, buffer.data(), buffer.size(), 0) <= 0) end_child();
    } else if (!read_line(theirs_)) {
      end_child();
    }
    write_all(theirs_, answer_.data(), answer_.size());
  }
}

double EchoProcess::round_trip() {
  const auto start = std::chrono::steady_clock::now();
  write_all(ours_, question_.data(), question_.size());
  if (path_ == Transport::udp) {
    std::array<char, 2048> buffer;
    require(::recv(ours_, buffer.data(), buffer.size(), 0) > 0, "recv");
  } else {
    require(read_line(ours_), "read");
  }
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace r4::bench
