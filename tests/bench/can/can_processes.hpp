// SPDX-License-Identifier: GPL-3.0-or-later
// The other ends of the CAN benchmark, each in a process of its own on vcan0: a board of ours, a
// plain program on the kernel's ISO-TP sockets, and senders of both kinds.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>

#include "tests/bench/link/child_process.hpp"
#include "tests/can/kernel_isotp.hpp"

namespace r4::bench {

// Who is who on the bus; the ids of each are those of can_ids.hpp.
constexpr std::uint8_t our_node = 5;
constexpr std::uint8_t kernel_node = 6;

// The kernel's sockets for the two lanes of a node, from either end.
test::KernelIsotp kernel_dialogue(bool board);
test::KernelIsotp kernel_telemetry(bool board);

// A simulated board whose clock stands still while a round trip is measured, but for every command
// that it executes: that takes it to the time of the next state, which confirms the command.
class CanBoardProcess : public ChildProcess {
 public:
  CanBoardProcess();
  static std::string url();
  void let_time_pass(bool wanted) const;
  // Of all datagrams that it has sent so far; the mean of those sent between two calls.
  std::size_t mean_size();

 private:
  struct Sent {
    std::uint64_t datagrams = 0, bytes = 0;
  };
  [[noreturn]] void serve() const;
  Sent before_;
};

// Answers each datagram of the dialogue with one of `answer_size` bytes in the telemetry.
class KernelEchoProcess : public ChildProcess {
 public:
  explicit KernelEchoProcess(std::size_t answer_size);
};

enum class CanStack { ours, kernel };
enum class Lane { telemetry, dialogue };

// Sends datagrams, as many as go. In the telemetry, which has no flow control, it keeps at most
// `ahead` datagrams ahead of their receiver, so that nothing is lost: it is told of each.
class CanSenderProcess : public ChildProcess {
 public:
  static constexpr std::uint32_t ahead = 8;

  CanSenderProcess(CanStack stack, Lane lane, std::size_t datagram_size);
  ~CanSenderProcess();
  CanSenderProcess(const CanSenderProcess&) = delete;
  CanSenderProcess& operator=(const CanSenderProcess&) = delete;

  void begin(std::uint32_t count) const;
  void received() const { shared_->received.fetch_add(1, std::memory_order_release); }

 private:
  struct Shared {
    std::atomic<std::uint32_t> received{0};
  };
  void await_room(std::uint32_t sent) const;
  [[noreturn]] void serve(CanStack stack, Lane lane, const std::string& datagram);
  void serve_ours(Lane lane, const std::string& datagram);
  void serve_kernel(Lane lane, const std::string& datagram);
  std::uint32_t next_count();

  Shared* shared_;
};

}  // namespace r4::bench
