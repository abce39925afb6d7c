// SPDX-License-Identifier: GPL-3.0-or-later
// Callbacks and their handles. board_thread_test.cpp tests callbacks with the threads of a board.
#include "host/subscribers.hpp"

#include <gtest/gtest.h>

#include <memory>

namespace r4::test {
namespace {

// An object that a callback captures, and whose destructor cancels the callback.
struct Captured {
  Subscription subscription;
  int* gone = nullptr;
  ~Captured() {
    subscription.cancel();
    ++*gone;
  }
};

TEST(Subscribers, ReleaseCapturedObjectsOnceEvenIfThatCancelsThem) {
  int gone = 0;
  Subscribers<> kind;
  auto captured = std::make_shared<Captured>();
  captured->gone = &gone;
  Subscription copy = captured->subscription = kind.add([captured] {});
  captured.reset();
  EXPECT_EQ(gone, 0);
  copy.cancel();
  EXPECT_EQ(gone, 1);
}

TEST(Subscribers, CancelledDuringACallReleaseCapturesAfterIt) {
  int gone = 0;
  Subscribers<> kind;
  auto captured = std::make_shared<Captured>();
  captured->gone = &gone;
  int calls = 0;
  Captured* const inside = captured.get();
  captured->subscription = kind.add([captured, inside, &calls, &gone] {
    ++calls;
    inside->subscription.cancel();
    EXPECT_EQ(gone, 0) << "the captured object is still in use";
  });
  captured.reset();
  const auto call = [](auto& one) { one(); };
  kind.each(call);
  EXPECT_EQ(gone, 1);
  kind.each(call);
  EXPECT_EQ(calls, 1);
}

}  // namespace
}  // namespace r4::test
