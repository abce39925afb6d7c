// SPDX-License-Identifier: GPL-3.0-or-later
// main() of the test programs. Some tests measure promises about real time. A standstill of the
// machine (such as a paused virtual machine) breaks every bound. A thread that only reads the clock
// detects a standstill. A failure during a standstill proves nothing, so the test is repeated. Any
// other failure is final. integration/repeat.py has the same rule.
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>

namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr milliseconds standstill{20};  // the precision of the promises
constexpr int most_runs = 3;
constexpr const char* run_variable = "R4_TEST_RUN";

// Measures the longest time that this process could not run since begin().
class Watch {
 public:
  ~Watch() {
    done_ = true;
    thread_.join();
  }
  void begin() { longest_ = milliseconds{0}; }
  milliseconds longest() const { return longest_; }

 private:
  void look() {
    const milliseconds step{5};
    for (auto before = Clock::now(); !done_;) {
      std::this_thread::sleep_for(step);
      const auto now = Clock::now();
      const auto kept = std::chrono::duration_cast<milliseconds>(now - before);
      if (kept > longest_.load()) longest_ = kept;
      before = now;
    }
  }

  std::atomic<bool> done_{false};
  std::atomic<milliseconds> longest_{milliseconds{0}};
  std::thread thread_{[this] { look(); }};
};

// Records which tests failed during a standstill, and whether any other test failed.
class Failures final : public testing::EmptyTestEventListener {
 public:
  std::string to_repeat;  // in the form of --gtest_filter
  bool count = false;

 private:
  void OnTestStart(const testing::TestInfo&) override { watch_.begin(); }
  void OnTestEnd(const testing::TestInfo& test) override {
    if (test.result()->Passed() || test.result()->Skipped()) return;
    const milliseconds stood_still = watch_.longest();
    if (stood_still < standstill) {
      count = true;
      return;
    }
    const std::string name = std::string(test.test_suite_name()) + "." + test.name();
    to_repeat += (to_repeat.empty() ? "" : ":") + name;
    std::printf("The machine stood still for %lld ms: run again: %s\n",
                static_cast<long long>(stood_still.count()), name.c_str());
  }

  Watch watch_;
};

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  auto* const failures = new Failures;  // GoogleTest takes ownership
  testing::UnitTest::GetInstance()->listeners().Append(failures);
  const int status = RUN_ALL_TESTS();
  const char* variable = std::getenv(run_variable);
  const int runs = variable == nullptr ? 1 : std::atoi(variable);
  if (status == 0 || failures->count || failures->to_repeat.empty() || runs >= most_runs)
    return status;
  std::fflush(stdout);
  ::setenv(run_variable, std::to_string(runs + 1).c_str(), 1);
  ::unsetenv("GTEST_TOTAL_SHARDS");
  const std::string filter = "--gtest_filter=" + failures->to_repeat;
  ::execl("/proc/self/exe", argv[0], filter.c_str(), nullptr);
  return status;
}
