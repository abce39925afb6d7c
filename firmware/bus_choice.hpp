// SPDX-License-Identifier: GPL-3.0-or-later
// Chooses the I2C bus with the board's chips. If a PCA9685 answers only on the other bus, the board
// drives the chips on that bus, to keep the chips off, and stays in a fault. Otherwise the bus of
// the wiring is chosen. A board without a PCA9685 leaves the other bus to the user.
#pragma once

#include <cstdint>

#include "r4link/vocabulary.hpp"
#include "r4link/wiring/wiring.hpp"

namespace r4 {
namespace firmware {

struct BusChoice {
  int chips;                   // 0 or 1; the other bus is the user's
  ChipTrouble wiring_trouble;  // for BoardHardware::Config
  bool user_may;               // false: transfers of the user could reach the chips
};

// `answers`: bit n: a PCA9685 answers on bus n. `trouble`: the wiring's trouble before this choice.
inline BusChoice choose_bus(const Wiring& wiring, unsigned answers, ChipTrouble trouble) {
  const int named = wiring.at(SignalKind::chip_bus).number();
  const bool is_lost = trouble == ChipTrouble::damaged;
  const bool elsewhere = (answers >> named & 1U) == 0 && (answers >> (1 - named) & 1U) != 0;
  if (!elsewhere || !(is_lost || wiring.has_pca9685())) return {named, trouble, true};
  return {1 - named, is_lost ? trouble : ChipTrouble::other_bus, false};
}

}  // namespace firmware
}  // namespace r4
