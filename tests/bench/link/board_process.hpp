// SPDX-License-Identifier: GPL-3.0-or-later
// The other ends of the benchmarks, each in a separate process: a simulated board, and a plain
// program that answers every packet or line, the reference for the board's round trip. The
// processes are forked, so construct them before the first thread.
#pragma once

#include <cstdint>
#include <string>

#include "child_process.hpp"

namespace r4::bench {

// The resources that a process has used so far.
struct Usage {
  double cpu_s = 0;               // user and system
  std::uint64_t allocations = 0;  // calls of operator new
  std::uint64_t sent = 0;         // datagrams sent by the board
};
Usage own_usage();

enum class Transport { udp, pty };
const char* to_text(Transport path);

// A simulated board that sends states at 1000 Hz. If `unbound`, the board's clock and its stream of
// states run as fast as possible.
class BoardProcess : public ChildProcess {
 public:
  BoardProcess(Transport path, bool unbound);
  const std::string& url() const { return url_; }
  Usage usage() const;

 private:
  [[noreturn]] void serve(Transport path, bool unbound);
  std::string url_;
};

// Answers each packet or line with `answer_size` bytes, with blocking calls only.
class EchoProcess : public ChildProcess {
 public:
  EchoProcess(Transport path, std::size_t question_size, std::size_t answer_size);
  // Seconds from the question to the answer, with blocking calls.
  double round_trip();

 private:
  [[noreturn]] void serve();
  Transport path_;
  std::string question_, answer_;
  int ours_ = -1, theirs_ = -1;
};

}  // namespace r4::bench
