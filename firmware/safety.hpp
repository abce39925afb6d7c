// SPDX-License-Identifier: GPL-3.0-or-later
// Why the outputs are safe: the set of causes, each latched until its own way out (docs/safety.md).
//
//     cause      enters                                   leaves                      setpoints
//     link       owner silent, or its transport gone      the owner is back           kept
//     handle     dead-man's handle released               it is held again            cleared
//     proximity  something nearer than a threshold,       it is 5 cm beyond for       cleared
//                or a sensor with one is blind            500 ms, or off
//     stop       E:STOP                                   E:CLEAR                     cleared
//     fault      a chip or the firmware failed            E:CLEAR                     cleared
//     watchdog   a duty missed its deadline               E:CLEAR                     cleared
//
// The outputs are safe while any cause is there. The board reports the gravest one: stop, fault,
// watchdog, handle, proximity, link. E:CLEAR takes away only the one that is reported, so that
// nobody clears what they have not seen.
#pragma once

#include <cstdint>

#include "../protocol/units.hpp"

namespace r4 {
namespace firmware {

class Safety {
 public:
  // Adds a cause. True if it was not there.
  bool enter(SafeReason cause);
  // Takes a cause away. True if it was there.
  bool leave(SafeReason cause);
  // E:CLEAR: takes the reported cause away if it is stop, fault or watchdog.
  void clear();

  bool is_safe() const { return causes_ != 0; }
  bool has(SafeReason cause) const { return (causes_ & bit(cause)) != 0; }
  SafeReason reason() const;

 private:
  static std::uint8_t bit(SafeReason cause) {
    return static_cast<std::uint8_t>(1U << static_cast<unsigned>(cause));
  }
  std::uint8_t causes_ = 0;
};

}  // namespace firmware
}  // namespace r4
