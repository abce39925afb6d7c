// SPDX-License-Identifier: GPL-3.0-or-later
// Callbacks and their handles; with a board's threads in board_thread_test.cpp.
#include "host/subscribers.hpp"

#include <gtest/gtest.h>

#include <memory>

namespace r4::test {
namespace {

// What a callback captures, and what ends the callback when it goes.
struct Captured {
  Subscription subscription;
  int* gone = nullptr;
  ~Captured() {
    subscription.cancel();
    ++*gone;
  }
};

TEST(Subscribers, LetGoOfWhatTheyHaveCapturedOnceAlsoWhereThatEndsThem) {
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

TEST(Subscribers, EndedWithinTheCallLetGoWhenItIsOver) {
  int gone = 0;
  Subscribers<> kind;
  auto captured = std::make_shared<Captured>();
  captured->gone = &gone;
  int calls = 0;
  Captured* const inside = captured.get();
  captured->subscription = kind.add([captured, inside, &calls, &gone] {
    ++calls;
    inside->subscription.cancel();
    EXPECT_EQ(gone, 0) << "it is still needed";
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
