// SPDX-License-Identifier: GPL-3.0-or-later
#include "firmware/ports/sim/script.hpp"

#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>

#include "firmware/board_hardware.hpp"
#include "firmware/ports/sim/devices/user_devices.hpp"
#include "firmware/ports/sim/robot/board_model.hpp"
#include "r4link/error.hpp"
#include "r4link/state.hpp"

namespace r4::sim {
namespace {

using Kind = ScriptStep::Kind;

std::string error_of(const std::string& text) {
  try {
    Script::parse(text, "bench.txt");
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::data);
    EXPECT_FALSE(error.problem().fix.empty());
    return error.what();
  }
  return "";
}

TEST(Script, ReadsDeviceEvents) {
  const Script script = Script::parse(
      "1 userbus held\n1 userbus cut\n1 userbus stretched\n1 userbus free\n2 device mpu6050 off\n"
      "2 device ina219 reset",
      "bench.txt");
  const auto& steps = script.steps();
  ASSERT_EQ(steps.size(), 6U);
  const UserBusModel::Fault faults[] = {UserBusModel::Fault::held, UserBusModel::Fault::cut_off,
                                        UserBusModel::Fault::stretched, UserBusModel::Fault::none};
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(steps[i].kind, Kind::user_bus);
    EXPECT_EQ(steps[i].value, static_cast<std::int32_t>(faults[i]));
  }
  EXPECT_EQ(steps[4].channel, static_cast<int>(UserDevice::mpu6050));
  EXPECT_EQ(steps[4].value, static_cast<std::int32_t>(ScriptStep::Supply::off));
  EXPECT_EQ(steps[5].kind, Kind::device);
  EXPECT_EQ(steps[5].channel, static_cast<int>(UserDevice::ina219));
  EXPECT_EQ(steps[5].value, static_cast<std::int32_t>(ScriptStep::Supply::reset));
  EXPECT_EQ(error_of("1 userbus broken"),
            "bench.txt:1: 'broken' is nothing a bus can be; write held, cut, stretched or free");
  EXPECT_EQ(error_of("1 device bmp280 off"),
            "bench.txt:1: 'bmp280' is not a device on the user's bus; write mpu6050, "
            "ina219, icm20948, bno055, vl53l0x or as5600");
}

TEST(Script, ReadsEveryKindOfStep) {
  const Script script = Script::parse(
      "# a day on the bench\n"
      "\n"
      "0.5 handle released   # let go\n"
      "1 us 1 15\n"
      "\t1.25   enc 2 -100\r\n"
      "1.5 analog AIN24 21.5\n"
      "2 handle held\n"
      "3 fault\n"
      "3.125 watchdog\n"
      "4 reboot",
      "bench.txt");
  const auto& steps = script.steps();
  ASSERT_EQ(steps.size(), 8U);

  EXPECT_EQ(steps[0].kind, Kind::handle);
  EXPECT_EQ(steps[0].at_ms, 500U);
  EXPECT_EQ(steps[0].value, 0);

  EXPECT_EQ(steps[1].kind, Kind::ultrasonic);
  EXPECT_EQ(steps[1].at_ms, 1000U);
  EXPECT_EQ(steps[1].channel, 1);
  EXPECT_EQ(steps[1].value, 15);

  EXPECT_EQ(steps[2].kind, Kind::encoder);
  EXPECT_EQ(steps[2].at_ms, 1250U);
  EXPECT_EQ(steps[2].channel, 2);
  EXPECT_EQ(steps[2].value, -100);

  EXPECT_EQ(steps[3].kind, Kind::analog);
  EXPECT_EQ(steps[3].channel, static_cast<int>(Analog::ain24));
  EXPECT_EQ(steps[3].value, 2150);

  EXPECT_EQ(steps[4].value, 1);
  EXPECT_EQ(steps[5].kind, Kind::fault);
  EXPECT_EQ(steps[6].kind, Kind::watchdog);
  EXPECT_EQ(steps[6].at_ms, 3125U);
  EXPECT_EQ(steps[7].kind, Kind::reboot);
}

TEST(Script, NamesEveryAnalogInput) {
  const char* const names[] = {"AIN24", "AIN12", "AIN5", "AINDMH", "AINSTEER", "AIN6"};
  for (int i = 0; i < analog_channels; ++i) {
    const auto script = Script::parse(std::string("0 analog ") + names[i] + " 1", "x");
    EXPECT_EQ(script.steps().at(0).channel, i) << names[i];
  }
}

TEST(Script, SortsStepsByTimeAndKeepsTheOrderOfLines) {
  const Script script = Script::parse("2 enc 1 1\n1 enc 1 2\n2 enc 1 3\n", "x");
  ASSERT_EQ(script.steps().size(), 3U);
  EXPECT_EQ(script.steps()[0].value, 2);
  EXPECT_EQ(script.steps()[1].value, 1);
  EXPECT_EQ(script.steps()[2].value, 3);
}

TEST(Script, IsEmptyWithoutSteps) {
  EXPECT_TRUE(Script::parse("", "x").steps().empty());
  EXPECT_TRUE(Script::parse("# nothing\n\n  \n", "x").steps().empty());
}

TEST(Script, AnErrorNamesTheLineTheMistakeAndTheFix) {
  EXPECT_EQ(error_of("1 handle held\n2 handle open\n"),
            "bench.txt:2: 'open' is nothing a handle can be; write held or released");
  EXPECT_EQ(error_of("1 us 5 10"),
            "bench.txt:1: '5' is not a valid ultrasonic sensor; there are 1 to 4");
  EXPECT_EQ(error_of("1 us"),
            "bench.txt:1: 'us' has too few or too many words; write TIME us SENSOR CM|off");
}

TEST(Script, RefusesInvalidLines) {
  for (const char* line : {
           "handle held",           // no time
           "-1 handle held",        // before the start
           "1. handle held",        // half a number
           ".5 handle held",        //
           "1.2345 handle held",    // finer than a millisecond
           "1e3 handle held",       //
           "99999999 handle held",  // too long for the board's clock
           "1",                     // nothing to do
           "1 dance",               //
           "1 handle",              //
           "1 handle held now",     //
           "1 handle HELD",         //
           "1 us 0 10",             // sensors are 1 to 4
           "1 us one 10",           //
           "1 us 1 401",            // beyond the range of a sensor
           "1 us 1 -3",             //
           "1 enc 5 0",             //
           "1 enc 1 2147483648",    // more than 32 bits
           "1 enc 1 1.5",           //
           "1 analog AIN7 1",       //
           "1 analog SERVO1POS 1",  // a field, but not an input
           "1 analog AIN24 high",   //
           "1 fault 3",             //
           "1 reboot now",          //
       }) {
    EXPECT_NE(error_of(line), "") << line;
  }
}

TEST(Script, AnErrorInAFileNamesTheFileAndTheLine) {
  const std::string path = testing::TempDir() + "r4_script_test.txt";
  std::ofstream(path) << "1 reboot\n2 fall over\n";
  try {
    Script::load(path);
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.problem().thing, path + ":2");
  }
  std::remove(path.c_str());
}

TEST(Script, NamesAFileThatCannotBeRead) {
  for (const std::string path : {"/nonexistent/bench.txt", "/"}) {
    try {
      Script::load(path);
      FAIL() << "no error for " << path;
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::usage);
      EXPECT_EQ(error.problem().thing, path);
    }
  }
}

TEST(Script, ReadsChipBusAndLoopFaults) {
  const Script script = Script::parse(
      "1 chip dac off\n"
      "2 chip osmc reset\n"
      "3 i2c held\n"
      "4 i2c free\n"
      "5 hang 0.3\n"
      "6 us 2 off\n",
      "bench.txt");
  const auto& steps = script.steps();
  ASSERT_EQ(steps.size(), 6U);
  EXPECT_EQ(steps[0].kind, Kind::chip);
  EXPECT_EQ(steps[0].channel, static_cast<int>(Chip::dac));
  EXPECT_EQ(steps[0].value, static_cast<int>(ScriptStep::Supply::off));
  EXPECT_EQ(steps[1].channel, static_cast<int>(Chip::osmc_pwm));
  EXPECT_EQ(steps[1].value, static_cast<int>(ScriptStep::Supply::reset));
  EXPECT_EQ(steps[2].kind, Kind::i2c);
  EXPECT_EQ(steps[2].value, 1);
  EXPECT_EQ(steps[3].value, 0);
  EXPECT_EQ(steps[4].kind, Kind::hang);
  EXPECT_EQ(steps[4].value, 300);
  EXPECT_EQ(steps[5].value, ScriptStep::off);

  EXPECT_EQ(error_of("1 chip eeprom off"),
            "bench.txt:1: 'eeprom' is not a chip; write osmc, dhb, servo, expander or dac");
  EXPECT_EQ(error_of("1 chip dac broken"),
            "bench.txt:1: 'broken' cannot happen to a chip; write off, on or reset");
  EXPECT_EQ(error_of("1 i2c stuck"),
            "bench.txt:1: 'stuck' is nothing a bus can be; write held or free");
  EXPECT_EQ(error_of("1 hang long"),
            "bench.txt:1: 'long' is not a valid time; write for how long, in seconds such as 0.3");
  EXPECT_EQ(error_of("1 dance"),
            "bench.txt:1: 'dance' is nothing that can happen; use handle, us, enc, analog, "
            "divider, defect, motor, chip, i2c, userbus, device, uart, gpio, hang, fault, watchdog "
            "or reboot");
}

TEST(Script, ReadsDefects) {
  const Script script = Script::parse(
      "1 divider AIN12 0.5\n"
      "2 defect enc1a on\n"
      "3 defect enc4b off\n"
      "4 defect echo3 on\n"
      "5 defect relay8 on\n"
      "6 defect store on\n",
      "bench.txt");
  const auto& steps = script.steps();
  EXPECT_EQ(steps.at(0).kind, Kind::divider);
  EXPECT_EQ(steps.at(0).channel, static_cast<int>(Analog::ain12));
  EXPECT_EQ(steps.at(0).value, 50);
  EXPECT_EQ(steps.at(1).channel, sim::defects::encoder_a);
  EXPECT_EQ(steps.at(1).value, 1);
  EXPECT_EQ(steps.at(2).channel, sim::defects::encoder_b + 3);
  EXPECT_EQ(steps.at(2).value, 0);
  EXPECT_EQ(steps.at(3).channel, sim::defects::echo + 2);
  EXPECT_EQ(steps.at(4).channel, sim::defects::relay + 7);
  EXPECT_EQ(steps.at(5).channel, sim::defects::store);

  EXPECT_EQ(error_of("1 divider AIN24 11"),
            "bench.txt:1: '11' is not a factor; write 0 to 10, such as 0.5");
  EXPECT_EQ(error_of("1 defect enc5a on"),
            "bench.txt:1: 'enc5a' is not a defect; write enc1a … enc4b, echo1 …, "
            "relay1 …, handle, bypass, servos or store");
  EXPECT_EQ(error_of("1 defect handle held"),
            "bench.txt:1: 'held' is not on or off; write on or off");
}

TEST(Script, RefusesAnEndlessFile) {
  try {
    Script::load("/dev/zero");
    FAIL() << "the file was read";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::data);
    EXPECT_STREQ(error.what(),
                 "/dev/zero: the scenario is longer than 1 MB; give a file of lines such as: "
                 "0.5 handle released");
  }
}

}  // namespace
}  // namespace r4::sim
