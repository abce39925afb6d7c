// SPDX-License-Identifier: GPL-3.0-or-later
#include "explain_safe.hpp"

#include <fmt/format.h>

namespace r4 {

namespace {

Words wiring_words(ChipTrouble trouble) {
  switch (trouble) {
    case ChipTrouble::not_confirmed:
      return {"the board is safe: nobody has confirmed how it is wired",
              "compare the plan with its schematic (r4 wiring show serial:auto), then r4 wiring "
              "confirm serial:auto; or send E:CLEAR, until its next start"};
    case ChipTrouble::other_bus:
      return {"the board is safe: its chips answer on the other I2C bus than its wiring says",
              "correct 'chip bus' in the wiring file: r4 wiring give FILE serial:auto, then "
              "restart it"};
    default:
      return {"the board is safe: its stored wiring is damaged, and nothing is connected",
              "give it again: r4 wiring give FILE serial:auto, then restart it"};
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
              "check the way from here to the board (firewall, cable); the link comes back by "
              "itself"};
    case SafeReason::stop:
      return {"the board is safe: an emergency stop is latched",
              "send E:CLEAR when the danger is over"};
    case SafeReason::handle:
      return {"the board is safe: the dead-man's handle is released", "hold the handle"};
    case SafeReason::proximity:
      return {
          "the board is safe: something is nearer than a proximity threshold, or its sensor does "
          "not answer",
          "look at US1 to US4 of the state (F:DEFAULT,US1,US2,US3,US4), clear the way, or change "
          "the threshold with U:cm,ch (0 turns it off)"};
    case SafeReason::watchdog:
      return {"the board is safe: a duty of its firmware missed its deadline",
              "find out why, then send E:CLEAR or restart the board"};
    case SafeReason::fault:
      if (is_of_wiring(link)) return wiring_words(link.chip.trouble);
      if (link.chip.any()) {
        return {fmt::format("the board is safe: {}: {}", chip_name(link.chip.address),
                            to_text(link.chip.trouble)),
                "check that chip's supply and wiring, then send E:CLEAR"};
      }
      return {"the board is safe: it found a fault in itself",
              "check its chips and wiring, then send E:CLEAR or restart it"};
    case SafeReason::none:
      break;
  }
  return {"the board is safe", "E:CLEAR clears a stop, a fault and a watchdog"};
}

}  // namespace r4
