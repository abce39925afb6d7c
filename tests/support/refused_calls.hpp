// SPDX-License-Identifier: GPL-3.0-or-later
// Simulates a system that refuses resources: a descriptor for epoll, or a thread.
#pragma once

#include <gtest/gtest.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/epoll.h>
#include <sys/prctl.h>
#include <sys/syscall.h>

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <thread>
#include <vector>

namespace r4::test {

struct RefusedCall {
  long number;
  int error;
  // If set, only calls with this second argument are refused.
  std::optional<std::uint32_t> second_argument;
};

// The user has reached the limit of descriptors for epoll (fs.epoll.max_user_watches).
inline const RefusedCall no_watches{SYS_epoll_ctl, ENOSPC, EPOLL_CTL_ADD};
// The user has reached the limit of threads (ulimit -u).
inline const RefusedCall no_threads{SYS_clone3, EAGAIN, std::nullopt};

// From now on the kernel refuses the call to this thread. The refusal ends only with the thread.
inline void refuse(const RefusedCall& call) {
  const auto load = [](std::size_t offset) {
    return sock_filter(BPF_STMT(BPF_LD | BPF_W | BPF_ABS, static_cast<std::uint32_t>(offset)));
  };
  const auto otherwise = [](std::uint32_t value, std::uint8_t skipped) {
    return sock_filter(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, value, 0, skipped));
  };
  const auto end = [](std::uint32_t how) { return sock_filter(BPF_STMT(BPF_RET | BPF_K, how)); };
  std::vector<sock_filter> filter{load(offsetof(seccomp_data, nr))};
  const bool all = !call.second_argument;
  filter.push_back(otherwise(static_cast<std::uint32_t>(call.number), all ? 1 : 3));
  if (!all) {
    filter.push_back(load(offsetof(seccomp_data, args) + sizeof(std::uint64_t)));
    filter.push_back(otherwise(*call.second_argument, 1));
  }
  filter.push_back(end(SECCOMP_RET_ERRNO | static_cast<std::uint32_t>(call.error)));
  filter.push_back(end(SECCOMP_RET_ALLOW));
  const sock_fprog program{static_cast<unsigned short>(filter.size()), filter.data()};
  ASSERT_EQ(::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0), 0);
  ASSERT_EQ(::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program), 0);
}

inline void in_a_thread_of_its_own(const std::function<void()>& test) { std::thread(test).join(); }

}  // namespace r4::test
