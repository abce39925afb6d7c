// SPDX-License-Identifier: GPL-3.0-or-later
// The other ends of the CAN benchmark, each in a separate process on vcan0: our board, our carrier
// alone, a plain program on the kernel's ISO-TP sockets, and senders of both kinds.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "tests/bench/link/child_process.hpp"
#include "tests/transports/can/kernel/kernel_isotp.hpp"

namespace r4::bench {

// The nodes on the bus. can_ids.hpp defines their ids.
constexpr std::uint8_t kernel_node = 6;

// The form of our datagrams. The kernel's end carries plain datagrams in both cases.
enum class Form { plain, packed };
const char* to_text(Form form);
// The user of a carrier: a session and a board, or only the benchmark. Each user has separate
// nodes.
enum class Above { all, nothing };
std::string host_url(Form form, Above above = Above::all);
std::string board_url(Form form,
                      Above above = Above::all);  // a URL does not state whether a board packs

// The kernel's sockets for the two lanes of a node, for either end.
test::KernelIsotp kernel_dialogue(bool board);
test::KernelIsotp kernel_telemetry(bool board);

// A simulated board whose clock stops while a round trip is measured. Each command that the board
// executes advances the clock to the time of the next state, which confirms the command.
class CanBoardProcess : public ChildProcess {
 public:
  // The datagrams sent, in the plain form that the program uses.
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

// A carrier of ours on the board's side, which answers each datagram of a host with `state`.
class CarrierEchoProcess : public ChildProcess {
 public:
  CarrierEchoProcess(Form form, const std::string& state);

 private:
  [[noreturn]] static void serve(Form form, const std::string& state, int ready);
};

// Answers each datagram of the dialogue with a telemetry datagram of the length that the datagram
// requests.
class KernelEchoProcess : public ChildProcess {
 public:
  KernelEchoProcess();
  static std::string question(std::size_t size, std::uint16_t answer_size);
};

enum class Lane { telemetry, dialogue };

// The telemetry has no flow control. A sender stays at most this many datagrams ahead of its
// receiver, so that no datagram is lost. The receiver reports each datagram to the sender.
constexpr std::uint32_t ahead = 8;
void await_room(const SharedCount& received, std::uint32_t sent);
std::uint32_t next_count(int control);

class CanSenderProcess : public ChildProcess {
 public:
  // With a form, sends on our stack. Without a form, sends on the kernel's ISO-TP.
  CanSenderProcess(std::optional<Form> ours, Lane lane, const std::string& datagram);

  void begin(std::uint32_t count) const;
  void received() const { received_.add_one(); }

 private:
  void serve_ours(Form form, Lane lane, const std::string& datagram);
  void serve_kernel(Lane lane, const std::string& datagram);

  SharedCount received_;
};

}  // namespace r4::bench
