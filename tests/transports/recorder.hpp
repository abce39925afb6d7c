// SPDX-License-Identifier: GPL-3.0-or-later
// For tests of carriers: a handler that records its calls, and functions that wait for events.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <asio/io_context.hpp>
#include <asio/steady_timer.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "r4link/carrier.hpp"
#include "transports/registry.hpp"

namespace r4::test {

using Clock = std::chrono::steady_clock;
using Kind = CarrierEvent::Kind;

// A test that waits for this time has failed.
inline constexpr std::chrono::seconds patience{5};

class Recorder final : public Carrier::Handler {
 public:
  struct Datagram {
    std::string text;
    Peer from;
    Clock::time_point when;
  };
  struct Event {
    Kind kind;
    Problem problem;
    Clock::time_point when;
  };

  void on_datagram(std::string_view bytes, Peer from) override {
    datagrams.push_back({std::string(bytes), from, Clock::now()});
    if (then) then(datagrams.back());
  }
  void on_carrier_event(const CarrierEvent& event) override {
    events.push_back({event.kind, event.problem, Clock::now()});
    if (then_event) then_event();
  }
  void on_drained() override { ++drained; }
  void on_overheard(std::string_view bytes) override {
    overheard.emplace_back(bytes);
    if (then_overheard) then_overheard();
  }
  void on_oversize(std::string_view beginning) override { oversize.emplace_back(beginning); }

  bool has(std::string_view text) const {
    return std::any_of(datagrams.begin(), datagrams.end(),
                       [text](const Datagram& each) { return each.text == text; });
  }
  std::size_t count(Kind kind) const {
    return static_cast<std::size_t>(std::count_if(
        events.begin(), events.end(), [kind](const Event& each) { return each.kind == kind; }));
  }
  const Event* last(Kind kind) const {
    const Event* found = nullptr;
    for (const Event& event : events) {
      if (event.kind == kind) found = &event;
    }
    return found;
  }

  std::vector<Datagram> datagrams;
  std::vector<Event> events;
  int drained = 0;
  std::vector<std::string> overheard;
  std::vector<std::string> oversize;
  std::function<void(const Datagram&)> then;  // called after the datagram is recorded
  std::function<void()> then_event;           // called after the event is recorded
  std::function<void()> then_overheard;       // called after the overheard datagram is recorded
};

// Runs the loop until `done()`. False if `done()` is false after `limit`.
template <class Done>
[[nodiscard]] bool run_until(asio::io_context& io, Done done, Clock::duration limit = patience) {
  const auto deadline = Clock::now() + limit;
  io.restart();
  while (!done()) {
    const auto now = Clock::now();
    if (now >= deadline) return false;
    // If the loop waits for nothing, the result cannot change.
    if (io.run_one_for(deadline - now) == 0 && io.stopped()) return done();
  }
  return true;
}

// Runs the loop for the given time, to check that something does not happen or to keep a rate.
inline void run_for(asio::io_context& io, Clock::duration time) {
  const auto never = [] { return false; };
  static_cast<void>(run_until(io, never, time));
}

inline double in_milliseconds(Clock::duration time) {
  return std::chrono::duration<double, std::milli>(time).count();
}

inline std::unique_ptr<Carrier> open_carrier(asio::io_context& io, const std::string& url,
                                             Role role, Recorder& recorder) {
  auto carrier = Registry::standard().make(io, url, role);
  carrier->open(recorder);
  return carrier;
}

// The Error that `action` throws. Empty if `action` throws no Error.
template <class Action>
std::optional<Error> error_of(Action action) {
  try {
    action();
  } catch (const Error& error) {
    return error;
  }
  return std::nullopt;
}

std::size_t open_descriptors();

// Runs `action` in a child process, and returns its exit status. If a signal ended the child: 126.
int run_in_child(const std::function<int()>& action);

// Like run_in_child(), as user nobody without privileges.
int run_unprivileged(const std::function<int()>& action);

}  // namespace r4::test
