// SPDX-License-Identifier: GPL-3.0-or-later
// The table of checks, in the order of the paper's sections 7.3 to 8.5.

#include <algorithm>
#include <string>

#include "check_functions.hpp"
#include "r4link/error.hpp"
#include "r4link/tables/state_fields.hpp"

namespace r4::commissioning {
namespace {

constexpr auto off = Section::supply_off;
constexpr auto wheels = Section::wheels_off_ground;

struct CheckRow {
  std::string_view name;
  int channels;  // 0: the board has only one
  Section section;
  std::string_view moves;
  std::string_view about;
  CheckFunction* run;
};
constexpr CheckRow rows[] = {
    {"identity", 0, off, "", "The board reports its identity.", check_identity},
    {"settings", 0, off, "", "The board keeps its wiring over a restart.", check_settings},
    {"chips", 0, off, "", "The chips of the paper's Figure 3 answer.", check_chips},
    {"supply", analog_channels, off, "", "An analog input shows what a multimeter shows.",
     check_supply},
    {"handle", 0, off, "", "The board reads whether the dead-man's handle is held.", check_handle},
    {"encoder", encoder_channels, off, "",
     "An encoder counts, and the counts rise when the wheel turns forward.", check_encoder},
    {"ultrasonic", ultrasonic_channels, off, "", "An ultrasonic sensor sees a hand.",
     check_ultrasonic},
    {"user bus", 0, off, "",
     "The user's I2C bus works; the report lists the addresses that answer.", check_user_bus},
    {"uart", uart_channels, off, "", "The board receives the bytes of a device at a user's UART.",
     check_uart},
    {"transports", 0, off, "",
     "The report lists the states a second and the losses of each transport.", check_transports},
    {"relay", relay_channels, off, "a relay clicks", "A relay closes.", check_relay},
    {"servo", servo_channels, off, "a servo goes to its middle", "A servo moves.", check_servo},
    {"motor supply", 0, wheels, "relay 1 closes", "Relay 1 gives the motors their supply.",
     check_motor_supply},
    {"osmc", osmc_channels, wheels, "a motor turns", "A motor turns as commanded.", check_osmc},
    {"dhb12", dhb12_channels, wheels, "a motor turns", "A motor turns as commanded.", check_dhb12},
    {"bldc", bldc_channels, wheels, "a motor turns", "A motor turns as commanded.", check_bldc},
    {"stepper", stepper_channels, wheels, "a stepper turns", "A stepper turns as commanded.",
     check_stepper},
    {"silence", 0, wheels, "a motor turns",
     "The board switches all outputs off when its host is silent.", check_silence},
    {"stop", 0, wheels, "relay 1 clicks", "A stop over each transport switches all outputs off.",
     check_stop},
};

std::string id_of(const CheckRow& row, int channel) {
  if (row.channels == 0) return std::string(row.name);
  if (row.run != check_supply) return std::string(row.name) + " " + std::to_string(channel);
  const Text input = name_of(state_field(FieldKind::analog, channel));
  return std::string(row.name) + " " + std::string(input.data(), input.size());
}

std::vector<Check> all_checks() {
  std::vector<Check> all;
  for (const CheckRow& row : rows) {
    for (int channel = 1; channel <= std::max(row.channels, 1); ++channel) {
      all.push_back({id_of(row, channel), row.section, row.moves, row.about,
                     static_cast<int>(&row - rows), channel});
    }
  }
  return all;
}

}  // namespace

const char* to_text(Section section) {
  return section == Section::supply_off ? "motor supply off" : "wheels off the ground";
}

const std::vector<Check>& checks() {
  static const std::vector<Check> all = all_checks();
  return all;
}

const Check& check_named(std::string_view id) {
  const auto found = std::find_if(checks().begin(), checks().end(),
                                  [&](const Check& check) { return check.id == id; });
  if (found != checks().end()) return *found;
  throw Error(ErrorKind::usage, std::string(id), "this is not a check",
              "use a check that r4 commission --list shows");
}

CheckFunction* function_of(const Check& check) { return rows[check.row].run; }

}  // namespace r4::commissioning
