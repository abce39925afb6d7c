// SPDX-License-Identifier: GPL-3.0-or-later
// The other ends of the CAN benchmark, each in a process of its own on vcan0: a board of ours, a
// carrier of ours alone, a plain program on the kernel's ISO-TP sockets, and senders of both kinds.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "tests/bench/link/child_process.hpp"
#include "tests/transports/can/kernel/kernel_isotp.hpp"

namespace r4::bench {

// Who is who on the bus; the ids of each are those of can_ids.hpp.
constexpr std::uint8_t kernel_node = 6;

// How ours travel. The kernel's end carries the plain datagrams beside both.
enum class Form { plain, packed };
const char* to_text(Form form);
// What uses a carrier: a session and a board, or the benchmark itself. Each has nodes of its own.
enum class Above { all, nothing };
std::string host_url(Form form, Above above = Above::all);
std::string board_url(Form form,
                      Above above = Above::all);  // whether a board packs is no matter of its URL

// The kernel's sockets for the two lanes of a node, from either end.
test::KernelIsotp kernel_dialogue(bool board);
test::KernelIsotp kernel_telemetry(bool board);

// A simulated board whose clock stands still while a round trip is measured, but for every command
// that it executes: that takes it to the time of the next state, which confirms the command.
class CanBoardProcess : public ChildProcess {
 public:
  // Datagrams that passed, as the program has them: not packed.
  struct Passed {
    std::uint64_t datagrams = 0, bytes = 0;
    Passed operator-(const Passed& before) const {
      return {datagrams - before.datagrams, bytes - before.bytes};
    }
    std::size_t mean_size() const {
      return datagrams == 0 ? 0 : static_cast<std::size_t>((bytes + datagrams / 2) / datagrams);
    }
  };

  explicit CanBoardProcess(Form form);
  void let_time_pass(bool wanted) const;
  Passed sent() const;

 private:
  [[noreturn]] void serve(Form form) const;
};

// A carrier of ours as a board has it, which answers each datagram of a host with `state`.
class CarrierEchoProcess : public ChildProcess {
 public:
  CarrierEchoProcess(Form form, const std::string& state);

 private:
  [[noreturn]] static void serve(Form form, const std::string& state, int ready);
};

// Answers each datagram of the dialogue with one in the telemetry, as long as the question says.
class KernelEchoProcess : public ChildProcess {
 public:
  KernelEchoProcess();
  // A question of `size` bytes.
  static std::string question(std::size_t size, std::uint16_t answer_size);
};

enum class Lane { telemetry, dialogue };

// A sender of the telemetry, which has no flow control, keeps at most so many datagrams ahead of their
// receiver, so that nothing is lost: it is told of each.
constexpr std::uint32_t ahead = 8;
void await_room(const SharedCount& received, std::uint32_t sent);
// How many datagrams a sender is to send next.
std::uint32_t next_count(int control);

// Sends datagrams, as many as go.
class CanSenderProcess : public ChildProcess {
 public:
  // On our stack, or (no form) on the kernel's.
  CanSenderProcess(std::optional<Form> ours, Lane lane, const std::string& datagram);

  void begin(std::uint32_t count) const;
  void received() const { received_.add_one(); }

 private:
  void serve_ours(Form form, Lane lane, const std::string& datagram);
  void serve_kernel(Lane lane, const std::string& datagram);

  SharedCount received_;
};

}  // namespace r4::bench
