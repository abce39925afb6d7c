// SPDX-License-Identifier: GPL-3.0-or-later
#include "explain_safe.hpp"

#include <fmt/format.h>

namespace r4 {

namespace {

Words wiring_words(ChipTrouble trouble) {
  switch (trouble) {
    case ChipTrouble::not_confirmed:
      return {"the board is safe: its wiring is not confirmed",
              "compare the plan with the board's schematic (r4 wiring show serial:auto), then "
              "confirm it: r4 wiring confirm serial:auto; or send E:CLEAR after each start"};
    case ChipTrouble::other_bus:
      return {
          "the board is safe: its chips do not answer on the I2C bus of its wiring, but on the "
          "other bus",
          "correct 'chip bus' in the wiring file: r4 wiring give FILE serial:auto, then restart "
          "the board"};
    default:
      return {"the board is safe: its stored wiring is damaged, so no signal is connected",
              "give the wiring again: r4 wiring give FILE serial:auto, then restart the board"};
  }
}

}  // namespace

bool is_of_wiring(const LinkStatus& link) {
  return link.reason == SafeReason::fault && link.chip.any() && link.chip.address == 0;
}

Words safe_words(const LinkStatus& link) {
  switch (link.reason) {
    case SafeReason::link:
      return {"the board is safe: it does not hear our heartbeats",
              "check the path from this computer to the board (firewall, cable); the link then "
              "comes back automatically"};
    case SafeReason::stop:
      return {"the board is safe: an emergency stop is latched",
              "send E:CLEAR when the danger is over"};
    case SafeReason::handle:
      return {"the board is safe: the dead-man's handle is released", "hold the handle"};
    case SafeReason::proximity:
      return {
          "the board is safe: an obstacle is nearer than a proximity threshold, or a sensor does "
          "not answer",
          "check US1 to US4 of the state (F:DEFAULT,US1,US2,US3,US4), clear the way, or change the "
          "threshold with U:cm,ch (0 turns it off)"};
    case SafeReason::watchdog:
      return {"the board is safe: a task of its firmware missed its deadline",
              "find the cause, then send E:CLEAR or restart the board"};
    case SafeReason::fault:
      if (is_of_wiring(link)) return wiring_words(link.chip.trouble);
      if (link.chip.any()) {
        return {fmt::format("the board is safe: {}: {}", chip_name(link.chip.address),
                            to_text(link.chip.trouble)),
                "check that chip's supply and wiring, then send E:CLEAR"};
      }
      return {"the board is safe: it found a fault in itself",
              "check the board's chips and wiring, then send E:CLEAR or restart the board"};
    case SafeReason::none:
      break;
  }
  return {
      "the board is safe",
      "find the reason in the board's SAFE field; E:CLEAR clears a stop, a fault and a watchdog"};
}

}  // namespace r4
