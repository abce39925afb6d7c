// SPDX-License-Identifier: GPL-3.0-or-later
// The cost of `r4 bridge`, compared with a bare forwarder that only polls, reads and writes. Bridge
// and forwarder are separate processes that run at the same time and are measured in turns.
//
//     r4_bridge_bench [R4, default build/r4] [datagrams, default 4000]
//
// If a limit is not met, the exit code is 1. UDP to a pty and back with datagrams of 170 bytes: at
// most 1.15 times the forwarder's median one-way time, and at most 1.3 times the forwarder's
// processor time. UDP to UDP: at least 100,000 datagrams a second, in order.
#include <arpa/inet.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "../link/child_process.hpp"
#include "tests/support/datagrams.hpp"

namespace r4::bench {
namespace {

using Clock = std::chrono::steady_clock;
constexpr std::size_t datagram_size = 170;
constexpr int in_a_turn = 50;
constexpr std::chrono::microseconds pace{500};
constexpr int patience_ms = 5000;

bool all_met = true;

const char* verdict(bool met) {
  all_met = all_met && met;
  return met ? "met" : "MISSED";
}

// --- datagrams

std::string datagram(bool of_board, std::uint32_t number) {
  std::string fields = of_board ? "AIN24:24.28;AIN12:12.18;" : "H:ROS2-R4;";
  fields += "PNum:" + std::to_string(number) + ";T:" + std::to_string(number) + ";PAD:";
  const std::size_t tail = std::string_view(";^0x12345678^").size();
  fields.append(datagram_size - tail - fields.size(), 'x');
  fields += ';';
  return test::with_crc(fields);
}

std::uint32_t number_of(std::string_view bytes) {
  return static_cast<std::uint32_t>(std::atoi(bytes.data() + bytes.find("PNum:") + 5));
}

// --- ends

class Socket {
 public:
  Socket() : number_(::socket(AF_INET, SOCK_DGRAM, 0)) {
    const sockaddr_in any = address_of(0);
    require(::bind(number_, reinterpret_cast<const sockaddr*>(&any), sizeof any) == 0, "bind");
    const int room = 4 << 20;
    ::setsockopt(number_, SOL_SOCKET, SO_RCVBUF, &room, sizeof room);
  }
  ~Socket() { ::close(number_); }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;

  static sockaddr_in address_of(std::uint16_t port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return address;
  }
  std::uint16_t port() const {
    sockaddr_in address{};
    socklen_t size = sizeof address;
    ::getsockname(number_, reinterpret_cast<sockaddr*>(&address), &size);
    return ntohs(address.sin_port);
  }
  void connect(std::uint16_t port) const {
    const sockaddr_in address = address_of(port);
    require(::connect(number_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0,
            "connect");
  }
  int number() const { return number_; }

 private:
  const int number_;
};

std::uint16_t free_port() { return Socket().port(); }

void make_raw(int tty) {
  termios settings{};
  ::tcgetattr(tty, &settings);
  ::cfmakeraw(&settings);
  ::tcsetattr(tty, TCSANOW, &settings);
}

class Pty {
 public:
  Pty() : number_(::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK)) {
    require(number_ >= 0 && ::grantpt(number_) == 0 && ::unlockpt(number_) == 0, "pty");
    path_ = ::ptsname(number_);
    slave_ = ::open(path_.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK);
    require(slave_ >= 0, path_.c_str());
    make_raw(slave_);
  }
  ~Pty() {
    ::close(slave_);
    ::close(number_);
  }
  Pty(const Pty&) = delete;
  Pty& operator=(const Pty&) = delete;
  int number() const { return number_; }
  int slave() const { return slave_; }
  const std::string& path() const { return path_; }

 private:
  const int number_;
  int slave_ = -1;
  std::string path_;
};

// --- forwarders

class Forwarder {
 public:
  Forwarder() = default;
  ~Forwarder() {
    ::kill(pid_, SIGTERM);
    ::waitpid(pid_, nullptr, 0);
  }
  Forwarder(const Forwarder&) = delete;
  Forwarder& operator=(const Forwarder&) = delete;

  void run_bridge(const std::string& r4, const std::string& hosts, const std::string& board) {
    std::fflush(stdout);
    pid_ = ::fork();
    if (pid_ != 0) return;
    end_with_parent();
    require(std::freopen("/dev/null", "w", stdout) != nullptr &&
                std::freopen("/dev/null", "w", stderr) != nullptr,
            "/dev/null");
    ::execl(r4.c_str(), r4.c_str(), "bridge", hosts.c_str(), board.c_str(), "--every", "1000",
            nullptr);
    require(false, r4.c_str());
  }

  // If `line_end`, `board` is a stream, so add line ends.
  void run_bare(std::uint16_t port, int board, bool line_end) {
    std::fflush(stdout);
    pid_ = ::fork();
    if (pid_ != 0) return;
    end_with_parent();
    const int hosts = ::socket(AF_INET, SOCK_DGRAM, 0);
    const sockaddr_in at = Socket::address_of(port);
    require(::bind(hosts, reinterpret_cast<const sockaddr*>(&at), sizeof at) == 0, "bind");
    sockaddr_in host{};
    socklen_t host_size = sizeof host;
    std::array<pollfd, 2> ends{{{hosts, POLLIN, 0}, {board, POLLIN, 0}}};
    std::array<char, 4096> bytes;
    for (;;) {
      ::poll(ends.data(), ends.size(), -1);
      if ((ends[0].revents & POLLIN) != 0) {
        host_size = sizeof host;
        ssize_t size = ::recvfrom(hosts, bytes.data(), bytes.size() - 2, MSG_DONTWAIT,
                                  reinterpret_cast<sockaddr*>(&host), &host_size);
        if (size > 0 && line_end) {
          bytes[static_cast<std::size_t>(size++)] = '\r';
          bytes[static_cast<std::size_t>(size++)] = '\n';
        }
        if (size > 0 && ::write(board, bytes.data(), static_cast<std::size_t>(size)) < 0) continue;
      }
      if ((ends[1].revents & POLLIN) != 0) {
        const ssize_t size = ::read(board, bytes.data(), bytes.size());
        if (size > 0) {
          ::sendto(hosts, bytes.data(), static_cast<std::size_t>(size), MSG_DONTWAIT,
                   reinterpret_cast<const sockaddr*>(&host), host_size);
        }
      }
    }
  }

  static void end_with_parent() { ::prctl(PR_SET_PDEATHSIG, SIGTERM); }

  double cpu_us() const {
    clockid_t clock{};
    require(::clock_getcpuclockid(pid_, &clock) == 0, "clock_getcpuclockid");
    timespec used{};
    ::clock_gettime(clock, &used);
    return static_cast<double>(used.tv_sec) * 1e6 + static_cast<double>(used.tv_nsec) / 1e3;
  }

 private:
  pid_t pid_ = -1;
};

// A forwarder and both ends of its path, which this process owns.
struct Path {
  int host;   // a connected socket
  int board;  // a pty's master, or a socket
  bool stream;
  Forwarder& by;
  std::uint32_t number = 0;
  std::array<std::vector<double>, 2> took_us{};  // index 0: to the board, 1: to the host
  std::array<double, 2> cpu_us{};

  // Sends one datagram and waits for it. False if the datagram does not arrive within `limit_ms`.
  bool carry(bool to_host, int limit_ms, double* took) {
    std::string bytes = datagram(to_host, ++number);
    const std::size_t expected = bytes.size();
    if (to_host && stream) bytes += "\r\n";
    const int from = to_host ? board : host;
    const int to = to_host ? host : board;
    const auto began = Clock::now();
    if (::write(from, bytes.data(), bytes.size()) < 0) return false;
    std::array<char, 4096> received;
    std::size_t size = 0;
    while (size < expected) {
      pollfd end{to, POLLIN, 0};
      if (::poll(&end, 1, limit_ms) <= 0) return false;
      const ssize_t got = ::read(to, received.data() + size, received.size() - size);
      if (got > 0) size += static_cast<std::size_t>(got);
    }
    *took = std::chrono::duration<double, std::micro>(Clock::now() - began).count();
    return true;
  }

  // Waits until the forwarder forwards in both directions.
  void begin() {
    double ignored = 0;
    for (int i = 0; i < 100; ++i) {
      if (carry(false, 50, &ignored) && carry(true, 50, &ignored)) return drain();
    }
    require(false, "nothing is forwarded");
  }
  void drain() const {
    std::array<char, 4096> bytes;
    for (const int end : {host, board}) {
      pollfd at{end, POLLIN, 0};
      while (::poll(&at, 1, 50) > 0 && ::read(end, bytes.data(), bytes.size()) > 0) {
      }
    }
  }

  void take_turn(bool to_host) {
    const double before = by.cpu_us();
    for (int i = 0; i < in_a_turn; ++i) {
      double took = 0;
      require(carry(to_host, patience_ms, &took), "a datagram was lost");
      took_us[to_host ? 1 : 0].push_back(took);
      const auto until = Clock::now() + pace;
      while (Clock::now() < until) {
      }
    }
    cpu_us[to_host ? 1 : 0] += by.cpu_us() - before;
  }
};

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

void compare(const std::string& r4, int datagrams) {
  const Pty bridged_pty;
  const Pty bare_pty;
  const Socket bridged_host;
  const Socket bare_host;
  const std::uint16_t bridged_port = free_port();
  const std::uint16_t bare_port = free_port();
  Forwarder bridge;
  Forwarder bare;
  bridge.run_bridge(r4, "udp://127.0.0.1:" + std::to_string(bridged_port),
                    "serial://" + bridged_pty.path());
  bare.run_bare(bare_port, bare_pty.slave(), true);
  bridged_host.connect(bridged_port);
  bare_host.connect(bare_port);
  Path bridged{bridged_host.number(), bridged_pty.number(), true, bridge};
  Path plain{bare_host.number(), bare_pty.number(), true, bare};
  bridged.begin();
  plain.begin();
  for (int turn = 0; turn < datagrams / in_a_turn; ++turn) {
    for (const bool to_host : {false, true}) {
      bridged.take_turn(to_host);
      plain.take_turn(to_host);
    }
  }
  std::printf("UDP and pty, %zu bytes: r4 bridge beside poll-read-write\n", datagram_size);
  for (const std::size_t to_host : {0U, 1U}) {
    const double ours = median(bridged.took_us[to_host]);
    const double theirs = median(plain.took_us[to_host]);
    const double count = static_cast<double>(bridged.took_us[to_host].size());
    const double our_cpu = bridged.cpu_us[to_host] / count;
    const double their_cpu = plain.cpu_us[to_host] / count;
    std::printf("  %s  one way p50 %6.1f beside %6.1f us, %.2f times (1.15): %s\n",
                to_host != 0 ? "pty to UDP" : "UDP to pty", ours, theirs, ours / theirs,
                verdict(ours <= 1.15 * theirs));
    std::printf("              processor   %6.2f beside %6.2f us, %.2f times (1.30): %s\n", our_cpu,
                their_cpu, our_cpu / their_cpu, verdict(our_cpu <= 1.3 * their_cpu));
  }
}

// Sends as fast as possible, with this many datagrams under way.
void flood(const std::string& r4, bool to_host, std::uint32_t count) {
  constexpr std::uint32_t under_way = 128;
  const Socket host;
  const Socket board;
  const std::uint16_t port = free_port();
  Forwarder bridge;
  bridge.run_bridge(r4, "udp://127.0.0.1:" + std::to_string(port),
                    "udp://127.0.0.1:" + std::to_string(board.port()) + "?listen=0");
  host.connect(port);
  std::array<char, 2048> bytes;
  sockaddr_in back{};
  socklen_t size = sizeof back;
  bool there = false;
  for (int i = 0; i < 100 && !there; ++i) {  // the board's socket gets the bridge's address
    const std::string heartbeat = datagram(false, 0);
    if (::write(host.number(), heartbeat.data(), heartbeat.size()) < 0) continue;
    pollfd end{board.number(), POLLIN, 0};
    there = ::poll(&end, 1, 50) > 0;
  }
  require(there, "nothing is forwarded");
  ::recvfrom(board.number(), bytes.data(), bytes.size(), 0, reinterpret_cast<sockaddr*>(&back),
             &size);
  require(::connect(board.number(), reinterpret_cast<const sockaddr*>(&back), size) == 0,
          "connect");

  std::vector<std::string> all;
  for (std::uint32_t i = 1; i <= count; ++i) all.push_back(datagram(to_host, i));
  const int from = to_host ? board.number() : host.number();
  const int to = to_host ? host.number() : board.number();
  std::uint32_t sent = 0, received = 0, reordered = 0, newest = 0;
  const double cpu_before = bridge.cpu_us();
  const auto began = Clock::now();
  auto progress = began;
  while (received < count && Clock::now() - progress < std::chrono::milliseconds(200)) {
    while (sent < count && sent - newest < under_way) {
      const std::string& next = all[sent++];
      if (::send(from, next.data(), next.size(), 0) < 0) break;
    }
    for (;;) {
      const ssize_t got = ::recv(to, bytes.data(), bytes.size() - 1, MSG_DONTWAIT);
      if (got <= 0) break;
      bytes[static_cast<std::size_t>(got)] = '\0';
      const std::uint32_t number = number_of({bytes.data(), static_cast<std::size_t>(got)});
      if (number == 0) continue;
      reordered += number < newest ? 1 : 0;
      newest = std::max(newest, number);
      ++received;
      progress = Clock::now();
    }
  }
  const double seconds = std::chrono::duration<double>(progress - began).count();
  const double cpu_us = (bridge.cpu_us() - cpu_before) / received;
  std::printf(
      "UDP to UDP, towards the %s: %.0f datagrams a second (100000): %s; %u lost, %u reordered "
      "(0): %s\n",
      to_host ? "host " : "board", received / seconds, verdict(received / seconds >= 1e5),
      count - received, reordered, verdict(reordered == 0 && received == count));
  std::printf("              processor   %6.2f us a datagram: %.0f a second of its own time\n",
              cpu_us, 1e6 / cpu_us);
}

}  // namespace
}  // namespace r4::bench

int main(int argc, char** argv) {
  const std::string r4 = argc > 1 ? argv[1] : "build/r4";
  const int datagrams = argc > 2 ? std::atoi(argv[2]) : 4000;
  r4::bench::compare(r4, datagrams);
  for (const bool to_host : {false, true}) {
    r4::bench::flood(r4, to_host, 50U * static_cast<std::uint32_t>(datagrams));
  }
  return r4::bench::all_met ? 0 : 1;
}
