// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/wiring/wiring_file.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <sstream>
#include <string>

#include "protocol/wiring/giga_pins.hpp"
#include "tests/support/problems.hpp"

namespace r4 {
namespace {

// The plan's text with `from` replaced by `to`.
std::string edited(const std::string& from, const std::string& to) {
  std::string text = write_wiring(plan_wiring());
  const std::size_t at = text.find(from);
  if (at == std::string::npos) {
    ADD_FAILURE() << from << " is not in the text";
    return text;
  }
  return text.replace(at, from.size(), to);
}

// Expects that reading `text` fails with these words.
void expect_error(const std::string& text, const std::string& where, const std::string& words) {
  const Problem problem = test::problem_of([&] { read_wiring(text, "robot.wiring"); });
  EXPECT_EQ(problem.kind, ErrorKind::data);
  EXPECT_TRUE(problem.text().starts_with(where)) << problem.text();
  EXPECT_TRUE(test::contains(problem.text(), words));
  EXPECT_FALSE(problem.fix.empty()) << problem.text();
}

int line_of(const std::string& text, const std::string& part) {
  int line = 1;
  for (const char c : text.substr(0, text.find(part))) line += c == '\n' ? 1 : 0;
  return line;
}

TEST(WiringFile, ReadsWhatItWrites) {
  Wiring wiring = plan_wiring();
  EXPECT_EQ(read_wiring(write_wiring(wiring)), wiring);
  wiring.at(SignalKind::chip_bus).byte = 1;
  wiring.at(SignalKind::handle).byte = 42 | Place::option_bit;
  wiring.at(SignalKind::osmc_pwm, 2).byte = 14 | Place::option_bit;
  wiring.at(SignalKind::osmc_direction, 2).byte = 15 | Place::option_bit;
  wiring.at(SignalKind::relay, 8) = Place();
  wiring.at(SignalKind::analog, 6).byte = 83;
  EXPECT_EQ(read_wiring(write_wiring(wiring)), wiring);
}

TEST(WiringFile, HasTheNamesThatAPersonReads) {
  const std::string text = write_wiring(plan_wiring());
  for (const char* line :
       {"r4-wiring 1\n", "\nchip bus = D20/D21\n", "\nchip dac = 0x61\n", "\nhandle = D42\n",
        "\nstepper 4 direction = D41\n", "\nencoder 1 index = D26\n", "\nanalog 6 = A5  # AIN6\n",
        "\ndhb12 1 pwm = dhb12.0  # DHB1A\n", "\nservo 16 = servo.15\n", "\nbldc 2 speed = VOUTB\n",
        "\nbldc 4 brake = GPA7\n", "\nrelay 8 = GPB7\n"}) {
    EXPECT_NE(text.find(line), std::string::npos) << line;
  }
}

TEST(WiringFile, TakesBlanksCommentsAndAnyOrder) {
  std::string text = "\r\n # first\n r4-wiring \t 1 # version\r\n";
  for (int i = signal_count - 1; i >= 0; --i) {
    text += "\t" + signal_name(i) + "=" + place_name(i, plan_wiring().places[i]) + "#\r\n";
  }
  EXPECT_EQ(read_wiring(text), plan_wiring());
}

TEST(WiringFile, NamesLineSignalReasonAndFix) {
  const std::string plan = write_wiring(plan_wiring());
  const auto at = [&](const std::string& part) {
    return "robot.wiring:" + std::to_string(line_of(plan, part)) + ": ";
  };
  expect_error("", "robot.wiring: ", "has no lines");
  expect_error("handle = D42\n", "robot.wiring:1: ", "expected 'r4-wiring 1'");
  expect_error("r4-wiring 2\n", "robot.wiring:1: ", "'r4-wiring 2' is not a valid first line");
  expect_error("r4-wiring 1\nhandle D42\n", "robot.wiring:2: ", "expected SIGNAL = PLACE");
  expect_error("r4-wiring 1\nhandle 1 = D42\n",
               "robot.wiring:2: ", "handle 1: is not a valid signal");
  expect_error("r4-wiring 1\nhandle = D42\n", "robot.wiring: ", "'chip bus' is missing");
  expect_error(plan + "handle = none\n", "robot.wiring:", "handle already has a place in line");
  expect_error(edited("handle = D42", "handle = D103"), at("handle = "),
               "handle: 'D103' is not a valid place: expected a pin, D0 to D102");
  expect_error(edited("handle = D42", "handle = D42 high"), at("handle = "), "expected 'low'");
  expect_error(edited("servo 3 = servo.2", "servo 3 = servo.2 low"), at("servo 3 = "),
               "expected nothing after the place");
  expect_error(edited("handle = D42", "handle = D20"), at("handle = "),
               "handle: D20 belongs to an I2C bus; choose another pin");
  expect_error(edited("handle = D42", "handle = D7"), at("handle = "), "half the supply");
  expect_error(edited("stepper 3 step = D4\n", "stepper 3 step = D42\n"), at("stepper 3 step"),
               "D42 is already the place of handle");
  expect_error(edited("encoder 1 a = D25", "encoder 1 a = D55"), at("encoder 1 a"),
               "D55 has interrupt line 8, which is also the line of the WiFi chip");
  expect_error(edited("ultrasonic 2 echo = D50", "ultrasonic 2 echo = D72"),
               at("ultrasonic 2 echo"),
               "D72 has interrupt line 3, which is also the line of encoder 2 b");
  expect_error(edited("stepper 2 direction = D36", "stepper 2 direction = none"),
               at("stepper 2 step"), "is connected, but stepper 2 direction is not");
  expect_error(edited("osmc 1 pwm = osmc.0", "osmc 1 pwm = dhb12.15"), at("osmc 1 pwm"),
               "osmc 1 direction, osmc.1, are on different chips");
  expect_error(edited("analog 6 = A5", "analog 6 = D47"), at("analog 6"), "A0 to A7");
  expect_error(edited("chip osmc = 0x40", "chip osmc = 0x70"), at("chip osmc"), "without 0x70");
  expect_error(edited("chip bus = D20/D21", "chip bus = none"), at("chip bus"), "SDA1/SCL1");
}

TEST(WiringFile, HostileTextIsShownShortAndPrintable) {
  const std::string hostile = "\x1b[2J\x07" + std::string(5000, 'x');
  for (const std::string& text :
       {hostile, "r4-wiring 1\n" + hostile + "\n", "r4-wiring 1\n" + hostile + " = D2\n",
        edited("handle = D42", "handle = " + hostile),
        edited("handle = D42", "handle = D42 " + hostile), std::string("\0\0\n", 3)}) {
    const std::string told = test::problem_of([&] { read_wiring(text); }).text();
    EXPECT_LT(told.size(), 400U);
    for (const char c : told) EXPECT_GE(static_cast<unsigned char>(c), 0x20) << told;
  }
  EXPECT_THROW(read_wiring(std::string(max_wiring_text + 1, '#')), Error);
  EXPECT_THROW(load_wiring("/dev/zero"), Error) << "endless";
}

// The tables of docs/reference/wiring.md.
TEST(WiringFile, ThePagesTablesAreThoseOfTheCheck) {
  std::ifstream file(R4_TEST_DATA "/../../docs/reference/wiring.md");
  std::stringstream page;
  page << file.rdbuf();
  std::map<int, std::string> rows;
  for (int pin = 0; pin < giga_pin_count; ++pin) {
    if (giga_pins[pin].user != PinUser::none) continue;
    Place place;
    place.byte = static_cast<std::uint8_t>(pin);
    rows[giga_pins[pin].number] += " " + place_name(signals::handle, place);
  }
  for (const auto& [line, pins] : rows) {
    const std::string row = "| " + std::to_string(line) + " |" + pins + " |\n";
    if (line == wifi_interrupt_line) continue;
    EXPECT_NE(page.str().find(row), std::string::npos) << row;
  }
  for (int signal = 0; signal < signal_count; ++signal) {
    const std::string name = signal_name(signal);
    EXPECT_NE(page.str().find("`" + name.substr(0, name.find(' '))), std::string::npos) << name;
  }
}

TEST(WiringFile, AFileThatCannotBeReadIsNamed) {
  const Problem problem = test::problem_of([] { load_wiring("/nowhere/robot.wiring"); });
  EXPECT_EQ(problem.kind, ErrorKind::open);
  EXPECT_EQ(problem.thing, "/nowhere/robot.wiring");
}

TEST(WiringNames, EverySignalAndPlaceHasItsOwn) {
  for (int signal = 0; signal < signal_count; ++signal) {
    EXPECT_EQ(signal_named(signal_name(signal)), signal);
    for (int byte = 0; byte < 256; ++byte) {
      Wiring wiring = plan_wiring();
      wiring.places[signal].byte = static_cast<std::uint8_t>(byte);
      const WiringFault fault = check(wiring).fault;
      if (fault == WiringFault::place || fault == WiringFault::option) continue;
      const Place place = wiring.places[signal];
      EXPECT_EQ(place_named(signal, place_name(signal, place)), place)
          << signal_name(signal) << ' ' << byte;
    }
  }
}

}  // namespace
}  // namespace r4
