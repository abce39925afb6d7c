// SPDX-License-Identifier: GPL-3.0-or-later
#include "safety.hpp"

namespace r4 {
namespace firmware {

namespace {

bool is_latched(SafeReason cause) {
  return cause == SafeReason::stop || cause == SafeReason::fault || cause == SafeReason::watchdog;
}

}  // namespace

bool Safety::enter(SafeReason cause) {
  const bool fresh = !has(cause);
  causes_ = static_cast<std::uint8_t>(causes_ | bit(cause));
  if (fresh && is_latched(cause)) again();
  return fresh;
}

bool Safety::leave(SafeReason cause) {
  const bool was = has(cause);
  causes_ = static_cast<std::uint8_t>(causes_ & ~bit(cause));
  return was;
}

void Safety::clear() {
  const SafeReason seen = reason();
  if (is_latched(seen)) leave(seen);
}

bool Safety::latched() const {
  return has(SafeReason::stop) || has(SafeReason::fault) || has(SafeReason::watchdog);
}

SafeReason Safety::reason() const {
  if (!is_safe()) return SafeReason::none;
  static const SafeReason gravest_first[] = {SafeReason::stop,      SafeReason::fault,
                                             SafeReason::watchdog,  SafeReason::handle,
                                             SafeReason::proximity, SafeReason::link};
  static_assert(sizeof gravest_first / sizeof *gravest_first == safe_reason_count - 1,
                "each reason but none has its place");
  for (const SafeReason cause : gravest_first) {
    if (has(cause)) return cause;
  }
  return SafeReason::none;
}

}  // namespace firmware
}  // namespace r4
