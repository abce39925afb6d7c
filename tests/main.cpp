// SPDX-License-Identifier: GPL-3.0-or-later
// main() of the test programs. Some tests set bounds to real time, as the promises that they test
// do. A machine that stands still in the middle (a virtual one that is paused) breaks them all. A
// thread that only looks at the clock tells: a failure during a standstill says nothing and is
// repeated, one without counts. integration/conftest.py has the same rule.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>
#include <vector>

namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr milliseconds standstill{20};  // as exact as the promises are
constexpr int most_runs = 3;
constexpr const char* run_variable = "R4_TEST_RUN";

// The longest that this process was kept from running, until done() is called.
class Watch {
 public:
  milliseconds done() {
    done_ = true;
    thread_.join();
    return longest_;
  }

 private:
  void look() {
    const milliseconds step{5};
    for (auto before = Clock::now(); !done_;) {
      std::this_thread::sleep_for(step);
      const auto now = Clock::now();
      longest_ = std::max(longest_, std::chrono::duration_cast<milliseconds>(now - before));
      before = now;
    }
  }

  std::atomic<bool> done_{false};
  milliseconds longest_{0};
  std::thread thread_{[this] { look(); }};
};

}  // namespace

int main(int argc, char** argv) {
  std::vector<char*> again(argv, argv + argc + 1);  // GoogleTest takes its options out of argv
  testing::InitGoogleTest(&argc, argv);
  Watch watch;
  const int status = RUN_ALL_TESTS();
  const milliseconds stood_still = watch.done();
  const char* variable = std::getenv(run_variable);
  const int runs = variable == nullptr ? 1 : std::atoi(variable);
  if (status == 0 || stood_still < standstill || runs >= most_runs) return status;
  std::printf("The machine stood still for %lld ms: run again.\n",
              static_cast<long long>(stood_still.count()));
  std::fflush(stdout);
  ::setenv(run_variable, std::to_string(runs + 1).c_str(), 1);
  ::execv("/proc/self/exe", again.data());
  return status;
}
