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
// nobody clears what they have not seen; and each that only E:CLEAR ends has a number, which E:CLEAR
// names, so that nobody clears what came since.
#pragma once

#include <cstdint>

#include "r4link/vocabulary.hpp"

namespace r4 {
namespace firmware {

class Safety {
 public:
  // Adds a cause. True if it was not there.
  bool enter(SafeReason cause);
  // A latched cause that was there has come again: it has a new number.
  void again() { newest_ = newest_ == INT32_MAX ? 1 : newest_ + 1; }
  // Takes a cause away. True if it was there.
  bool leave(SafeReason cause);
  // E:CLEAR: takes the reported cause away if it is stop, fault or watchdog.
  void clear();

  bool is_safe() const { return causes_ != 0; }
  bool has(SafeReason cause) const { return (causes_ & bit(cause)) != 0; }
  SafeReason reason() const;

  // Numbers are counted from there. Another at each boot, so that no E:CLEAR from before it fits.
  void count_from(std::uint32_t number) {
    newest_ = static_cast<std::int32_t>(number & 0x3FFFFFFFU);
  }
  // The number of the newest cause that only E:CLEAR ends.
  std::int32_t newest() const { return newest_; }
  // Is one of those there?
  bool latched() const;

 private:
  static std::uint8_t bit(SafeReason cause) {
    return static_cast<std::uint8_t>(1U << static_cast<unsigned>(cause));
  }
  std::uint8_t causes_ = 0;
  std::int32_t newest_ = 0;
};

}  // namespace firmware
}  // namespace r4
