// SPDX-License-Identifier: GPL-3.0-or-later
// No interrupt comes as long as it lives. For a few instructions; may be nested.
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
