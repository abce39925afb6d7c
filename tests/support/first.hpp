// SPDX-License-Identifier: GPL-3.0-or-later
// The first value that a callback sets, for the thread of the test. The callback holds a copy,
// because it may run after the end of the test.
#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <future>
#include <memory>
#include <utility>

namespace r4::test {

template <class Value>
class First {
 public:
  // Later values are ignored.
  void set(Value value) const {
    if (!state_->is_set.exchange(true)) state_->promise.set_value(std::move(value));
  }
  // If there is no value within 5 s, the test fails. May be called once.
  Value get() const {
    auto future = state_->promise.get_future();
    if (future.wait_for(std::chrono::seconds{5}) == std::future_status::ready) return future.get();
    ADD_FAILURE() << "no value came";
    return Value();
  }

 private:
  struct State {
    std::atomic<bool> is_set{false};
    std::promise<Value> promise;
  };
  std::shared_ptr<State> state_ = std::make_shared<State>();
};

}  // namespace r4::test
