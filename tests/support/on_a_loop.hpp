// SPDX-License-Identifier: GPL-3.0-or-later
// A loop that a test runs until a condition is true.
#pragma once

#include <gtest/gtest.h>

#include <asio/io_context.hpp>
#include <chrono>
#include <optional>

#include "r4link/link.hpp"

namespace r4::test {

struct OnALoop {
  // False if `done()` is not true within 10 s.
  template <class Done>
  [[nodiscard]] bool run_until(Done done) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds{10};
    io.restart();
    while (!done()) {
      if (std::chrono::steady_clock::now() > deadline) return false;
      // If the loop waits for nothing, the result cannot change.
      if (io.run_one_for(std::chrono::seconds{10}) == 0 && io.stopped()) return done();
    }
    return true;
  }
  // The result that `start` passes to its handler.
  template <class Start>
  CommandResult result_of(Start start) {
    std::optional<CommandResult> result;
    start([&](const CommandResult& r) { result = r; });
    EXPECT_FALSE(result) << "the handler must not run inside the call";
    EXPECT_TRUE(run_until([&] { return result.has_value(); }));
    return result.value_or(CommandResult{});
  }

  asio::io_context io;
};

}  // namespace r4::test
