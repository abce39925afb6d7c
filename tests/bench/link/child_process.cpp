// SPDX-License-Identifier: GPL-3.0-or-later
#include "child_process.hpp"

#include <sched.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <new>

namespace r4::bench {
namespace {

// If this process had two cores at its start, uses the first or second of these cores.
void run_on_core(int index) {
  static const cpu_set_t all = [] {
    cpu_set_t set;
    require(::sched_getaffinity(0, sizeof set, &set) == 0, "sched_getaffinity");
    return set;
  }();
  int left = CPU_COUNT(&all) > 1 ? index : 0;
  for (int core = 0; core < CPU_SETSIZE; ++core) {
    if (!CPU_ISSET(core, &all) || left-- > 0) continue;
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(core, &one);
    require(::sched_setaffinity(0, sizeof one, &one) == 0, "sched_setaffinity");
    return;
  }
}

int child_core = 1;

}  // namespace

void require(bool ok, const char* what) {
  if (ok) return;
  std::perror(what);
  std::abort();
}

void write_all(int fd, const void* data, std::size_t size) {
  require(::write(fd, data, size) == static_cast<ssize_t>(size), "write");
}
void read_all(int fd, void* data, std::size_t size) {
  auto* at = static_cast<char*>(data);
  while (size > 0) {
    const ssize_t got = ::read(fd, at, size);
    require(got > 0, "read");
    at += got;
    size -= static_cast<std::size_t>(got);
  }
}

const char* to_text(Placement placement) {
  return placement == Placement::two_cores ? "two cores" : "one core";
}

void place(Placement placement) {
  child_core = placement == Placement::two_cores ? 1 : 0;
  run_on_core(0);
}

SharedCount::SharedCount() {
  void* const memory =
      ::mmap(nullptr, sizeof *at_, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  require(memory != MAP_FAILED, "mmap");
  at_ = new (memory) std::atomic<std::uint32_t>(0);
}
SharedCount::~SharedCount() { ::munmap(at_, sizeof *at_); }

bool ChildProcess::fork_child() {
  int ends[2];
  require(::socketpair(AF_UNIX, SOCK_STREAM, 0, ends) == 0, "socketpair");
  std::fflush(nullptr);
  pid_ = ::fork();
  require(pid_ >= 0, "fork");
  control_ = ends[pid_ == 0 ? 1 : 0];
  ::close(ends[pid_ == 0 ? 0 : 1]);
  if (pid_ == 0) run_on_core(child_core);
  return pid_ == 0;
}

void ChildProcess::end_child() { std::_Exit(0); }

ChildProcess::~ChildProcess() {
  if (pid_ <= 0) return;
  ::kill(pid_, SIGKILL);
  ::waitpid(pid_, nullptr, 0);
  ::close(control_);
}

}  // namespace r4::bench
