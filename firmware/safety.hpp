// SPDX-License-Identifier: GPL-3.0-or-later
// Why the outputs are safe: causes, each latched until its own end (docs/reference/safety.md).
//     cause      enters                                   leaves                      setpoints
//     link       no host is in control: at boot, or it    a host takes control        kept
//                is silent, has left or lost its paths
//     handle     dead-man's handle released               handle held again            cleared
//     proximity  obstacle nearer than a threshold, or     5 cm beyond it for 500 ms,  cleared
//                a sensor with a threshold is blind       or threshold off
//     stop       E:STOP                                   E:CLEAR                     cleared
//     fault      a chip or the firmware failed            E:CLEAR                     cleared
//     watchdog   a duty missed its deadline               E:CLEAR                     cleared
//
// The outputs are safe while there is a cause. The board reports the gravest cause: stop, fault,
// watchdog, handle, proximity, link. E:CLEAR ends only the reported cause, which the host has seen.
// E:CLEAR names the number of the newest cause, so that no host clears a later cause.
#pragma once

#include <cstdint>

#include "r4link/vocabulary.hpp"

namespace r4 {
namespace firmware {

class Safety {
 public:
  // True if the cause is new.
  bool enter(SafeReason cause);
  // A latched cause has occurred again, so it gets a new number.
  void again() { newest_ = newest_ == INT32_MAX ? 1 : newest_ + 1; }
  // True if the cause was active.
  bool leave(SafeReason cause);
  void clear();

  bool is_safe() const { return causes_ != 0; }
  bool has(SafeReason cause) const { return (causes_ & bit(cause)) != 0; }
  SafeReason reason() const;

  // Different at each boot, so that an E:CLEAR from before the boot is refused.
  void count_from(std::uint32_t number) {
    newest_ = static_cast<std::int32_t>(number & 0x3FFFFFFFU);
  }
  // The number of the newest cause that only E:CLEAR ends.
  std::int32_t newest() const { return newest_; }
  bool latched() const;

 private:
  static std::uint8_t bit(SafeReason cause) {
    return static_cast<std::uint8_t>(1U << static_cast<unsigned>(cause));
  }
  std::uint8_t causes_ = bit(SafeReason::link);
  std::int32_t newest_ = 0;
};

}  // namespace firmware
}  // namespace r4
