// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <utility>

#include "config.hpp"

namespace r4 {

class Subscriber;

// The handle of one callback. Destroying it does not end the callback.
class R4LINK_API Subscription {
 public:
  Subscription() = default;  // an ended subscription
  explicit Subscription(const std::shared_ptr<Subscriber>& subscriber) : subscriber_(subscriber) {}

  // Ends the callback. After the return the callback does not run, except a callback that called
  // cancel(). Idempotent; any thread; also after the board is destroyed.
  void cancel();

 private:
  std::weak_ptr<Subscriber> subscriber_;
};

// Ends its subscription when it is destroyed.
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
