// SPDX-License-Identifier: GPL-3.0-or-later
// The example sketch, unchanged, on a fake Giga: it boots, communicates over USB and drives a
// motor.
#include <Arduino.h>

#include <firmware/ports/giga/library/examples/R4Board/R4Board.ino>

#undef abs
#undef bit
#undef max
#undef min
#undef round
#undef word

#include <cstdio>
#include <cstdlib>

#include "r4link/wiring/wiring_value.hpp"
#include "tests/giga/fake_giga.hpp"
#include "tests/support/datagrams.hpp"

namespace {

int number = 0;

void say(r4::fake::Giga& giga, const char* fields) {
  const std::string text = std::string(fields) + "PNum:" + std::to_string(++number) + ";T:1;";
  giga.usb_send(r4::test::with_crc(text) + "\r\n");
}

void expect(bool is_so, const char* what) {
  if (is_so) return;
  std::printf("not so: %s\n", what);
  std::_Exit(1);
}

}  // namespace

int main() {
  static r4::fake::Giga giga;
  giga.set_pin('I', 15, true);
  char value[r4::max_wiring_value];
  giga.stored["r4-settings"] =
      "wiring," + r4::test::str(r4::write_wiring_value(r4::plan_wiring(), value)) + "\n";
  giga.usb_open = true;
  setup();
  expect(giga.chips.pins().is_safe(), "outputs are off after setup()");
  for (int turn = 0; turn < 700; ++turn) loop();
  expect(giga.usb_host.find("H:R4-ROS2;PNum:0;T:0;^0xb10b3a06^") != std::string::npos,
         "it calls for a host as in the paper's Figure 3");
  say(giga, "H:ROS2-R4;");
  for (int turn = 0; turn < 50; ++turn) loop();
  say(giga, "O:358,1,1;");
  for (int turn = 0; turn < 50; ++turn) loop();
  expect(giga.chips.pins().osmc[0].pwm == 358, "a command reaches the pin");
  for (int turn = 0; turn < 1200; ++turn) loop();
  expect(giga.chips.pins().is_safe(), "silence makes it safe");
  std::puts("the sketch runs");
  std::fflush(stdout);
  std::_Exit(0);  // the firmware's threads never end
}
