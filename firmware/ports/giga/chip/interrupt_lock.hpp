// SPDX-License-Identifier: GPL-3.0-or-later
// Keeps interrupts off while it exists, for a few instructions. Locks may be nested.
#pragma once

#include "chip.hpp"

namespace r4 {
namespace giga {

class InterruptLock {
 public:
  InterruptLock() : before_(__get_PRIMASK()) { __disable_irq(); }
  ~InterruptLock() { __set_PRIMASK(before_); }
  InterruptLock(const InterruptLock&) = delete;
  InterruptLock& operator=(const InterruptLock&) = delete;

 private:
  const std::uint32_t before_;
};

}  // namespace giga
}  // namespace r4
