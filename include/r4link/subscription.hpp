// SPDX-License-Identifier: GPL-3.0-or-later
// The handle of a callback, by which it is ended.
#pragma once

#include <memory>
#include <utility>

#include "config.hpp"

namespace r4 {

class Subscriber;

// One callback. Letting go of this handle leaves the callback where it is.
class R4LINK_API Subscription {
 public:
  Subscription() = default;  // one that has ended
  explicit Subscription(const std::shared_ptr<Subscriber>& subscriber) : subscriber_(subscriber) {}

  // Ends it. When this returns, the callback will not be called again and, unless this is called
  // within it, is not running. Idempotent, from any thread, also when the board is gone.
  void cancel();

 private:
  std::weak_ptr<Subscriber> subscriber_;
};

// Ends its subscription with its own end.
class ScopedSubscription {
 public:
  ScopedSubscription() = default;
  ScopedSubscription(Subscription subscription)  // NOLINT(google-explicit-constructor)
      : subscription_(std::move(subscription)) {}
  ScopedSubscription(ScopedSubscription&& other) noexcept
      : subscription_(std::exchange(other.subscription_, {})) {}
  ScopedSubscription& operator=(ScopedSubscription&& other) noexcept {
    std::swap(subscription_, other.subscription_);
    return *this;
  }
  ~ScopedSubscription() { subscription_.cancel(); }

 private:
  Subscription subscription_;
};

}  // namespace r4
