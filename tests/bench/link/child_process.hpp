// SPDX-License-Identifier: GPL-3.0-or-later
// A process that a benchmark forks, for the other end of what it measures; make it before any thread.
// What the system refuses ends the benchmark.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <cstddef>
#include <cstdint>

namespace r4::bench {

// Where the two processes run: on a core each, or sharing one. Left to itself, the scheduler moves
// between the two, which differ by more than anything that is measured here.
enum class Placement { two_cores, one_core };
const char* to_text(Placement placement);
// Of this process, and of those forked from now on.
void place(Placement placement);

// With perror() of `what` if not `ok`.
void require(bool ok, const char* what);
// All of it, however long that takes.
void write_all(int fd, const void* data, std::size_t size);
void read_all(int fd, void* data, std::size_t size);

// A number that this process shares with those that it forks afterwards.
class SharedCount {
 public:
  SharedCount();
  ~SharedCount();
  SharedCount(const SharedCount&) = delete;
  SharedCount& operator=(const SharedCount&) = delete;

  void set(std::uint32_t count) const { at_->store(count, std::memory_order_release); }
  void add_one() const { at_->fetch_add(1, std::memory_order_release); }
  std::uint32_t get() const { return at_->load(std::memory_order_acquire); }

 private:
  std::atomic<std::uint32_t>* at_;
};

class ChildProcess {
 public:
  ChildProcess() = default;
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

 protected:
  // True in the child.
  bool fork_child();
  [[noreturn]] static void end_child();
  pid_t pid_ = -1;
  int control_ = -1;  // a socket to the other of parent and child
};

}  // namespace r4::bench
