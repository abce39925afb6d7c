// SPDX-License-Identifier: GPL-3.0-or-later
#include "subscribers.hpp"

namespace r4 {

void Subscription::cancel() {
  if (const std::shared_ptr<Subscriber> subscriber = subscriber_.lock()) subscriber->end();
  subscriber_.reset();
}

}  // namespace r4
