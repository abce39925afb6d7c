// SPDX-License-Identifier: GPL-3.0-or-later
#include "safety.hpp"

namespace r4 {
namespace firmware {

bool Safety::enter(SafeReason cause) {
  const bool fresh = !has(cause);
  causes_ = static_cast<std::uint8_t>(causes_ | bit(cause));
  return fresh;
}

bool Safety::leave(SafeReason cause) {
  const bool was = has(cause);
  causes_ = static_cast<std::uint8_t>(causes_ & ~bit(cause));
  return was;
}

void Safety::clear() {
  const SafeReason seen = reason();
  if (seen == SafeReason::stop || seen == SafeReason::fault || seen == SafeReason::watchdog) {
    leave(seen);
  }
}

SafeReason Safety::reason() const {
  if (!is_safe()) return SafeReason::none;
  static const SafeReason gravest_first[] = {SafeReason::stop,      SafeReason::fault,
                                             SafeReason::watchdog,  SafeReason::handle,
                                             SafeReason::proximity, SafeReason::link};
  for (const SafeReason cause : gravest_first) {
    if (has(cause)) return cause;
  }
  return SafeReason::none;
}

}  // namespace firmware
}  // namespace r4
