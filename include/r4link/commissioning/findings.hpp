// SPDX-License-Identifier: GPL-3.0-or-later
// The faults that a commissioning can find. Each finding names a thing, such as "osmc 1".
#pragma once

#include <cstdint>
#include <string_view>

#include "../config.hpp"

namespace r4::commissioning {

enum class Finding : std::uint8_t {
  wiring_damaged,
  not_kept,
  chip_absent,
  chip_at_another_address,
  chips_on_the_other_bus,
  chip_in_trouble,
  divider_wrong,
  no_voltage,
  handle_inverted,
  handle_elsewhere,
  handle_missing,
  handle_stuck,
  encoder_channel_dead,
  encoder_silent,
  echo_unsteady,
  ultrasonic_silent,
  ultrasonic_blocked,
  user_bus_stuck,
  uart_silent,
  uart_damaged,
  transport_dead,
  relay_dead,
  no_motor_supply,
  relay_1_not_in_supply,
  servo_without_supply,
  does_not_move,
  reversed,
  two_pwm,
  one_way,
  exchanged,
  silence_too_long,
  rolls_on,
  stop_too_slow,
  count
};

struct FindingText {
  std::string_view name;   // "handle inverted", for scripts; stable
  std::string_view wrong;  // one sentence
  std::string_view fix;    // one sentence
};
R4LINK_API const FindingText& text_of(Finding finding);
// The inverse of FindingText::name; Finding::count for an unknown name.
R4LINK_API Finding finding_named(std::string_view name);

}  // namespace r4::commissioning
