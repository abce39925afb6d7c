// SPDX-License-Identifier: GPL-3.0-or-later
// A forked process for the other end of a measurement. Construct the process before the first
// thread. If the system refuses a call, the benchmark ends.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <cstddef>
#include <cstdint>

namespace r4::bench {

// The cores of the two processes: one core each, or a shared core. Without a placement, the
// scheduler moves a process between cores, which costs more than the effects that are measured.
enum class Placement { two_cores, one_core };
const char* to_text(Placement placement);
// Applies to this process, and to processes that are forked later.
void place(Placement placement);

// If not `ok`, ends the process with perror(what).
void require(bool ok, const char* what);
void write_all(int fd, const void* data, std::size_t size);
void read_all(int fd, void* data, std::size_t size);

// A number that this process shares with processes that it forks later.
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
  int control_ = -1;  // a socket between parent and child
};

}  // namespace r4::bench
