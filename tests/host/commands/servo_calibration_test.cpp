// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/commands/servo_calibration.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "r4link/commands/command_text.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

using End = ServoCalibration::End;

const ServoCalibration elbow({Microseconds(1000), Degrees(-45)}, {Microseconds(2000), Degrees(45)});

template <class... Arguments>
concept MakesEnd = requires(Arguments... arguments) {
  End{arguments...};
};
static_assert(MakesEnd<Microseconds, Degrees>);
static_assert(!MakesEnd<Degrees, Microseconds> && !MakesEnd<int, int> && !MakesEnd<Microseconds>);
static_assert(std::is_constructible_v<Degrees, int> && !std::is_convertible_v<int, Degrees>);
static_assert(!std::is_constructible_v<Degrees, bool>);
static_assert(!std::is_constructible_v<Degrees, Microseconds>);
static_assert(!std::is_default_constructible_v<ServoCalibration>, "there is no usual servo");

TEST(ServoCalibration, InterpolatesLinearlyBetweenItsEnds) {
  EXPECT_EQ(elbow.pulse(Degrees(-45)).value, 1000);
  EXPECT_EQ(elbow.pulse(Degrees(0)).value, 1500);
  EXPECT_EQ(elbow.pulse(Degrees(30)).value, 1833);
  EXPECT_EQ(elbow.pulse(Degrees(45)).value, 2000);
  EXPECT_EQ(to_text(Command::servo(3, elbow.pulse(Degrees(30)))), "S:1833,3");
  EXPECT_DOUBLE_EQ(elbow.degrees(1250)->value, -22.5);
}

TEST(ServoCalibration, TheAngleMayDecreaseAsThePulseGrows) {
  const ServoCalibration back({Microseconds(2400), Degrees(0)}, {Microseconds(600), Degrees(180)});
  EXPECT_EQ(back.pulse(Degrees(0)).value, 2400);
  EXPECT_EQ(back.pulse(Degrees(45)).value, 1950);
  EXPECT_DOUBLE_EQ(back.degrees(600)->value, 180);
  EXPECT_FALSE(back.is_in_range(Degrees(-1)));
  EXPECT_FALSE(back.is_in_range(Degrees(181)));
}

TEST(ServoCalibration, RefusesAnAngleBeyondAnEnd) {
  for (const double beyond : {45.1, -45.1, 90.0, 1e300, -1e300}) {
    EXPECT_FALSE(elbow.is_in_range(Degrees(beyond))) << beyond;
    EXPECT_EQ(problem_of([&] { elbow.pulse(Degrees(beyond)); }).kind, ErrorKind::usage) << beyond;
  }
  EXPECT_EQ(problem_of([] { elbow.pulse(Degrees(60)); }).text(),
            "60 degrees: the angle is outside the servo's calibration; give -45 to 45");
  EXPECT_TRUE(elbow.is_in_range(Degrees(45.01)))
      << "less than half a microsecond outside of the range";
}

TEST(ServoCalibration, ConvertsEveryPulseToAnAngleAndBack) {
  const ServoCalibration odd({Microseconds(511), Degrees(-89.7)},
                             {Microseconds(2493), Degrees(93.1)});
  for (int us = 511; us <= 2493; ++us) EXPECT_EQ(odd.pulse(*odd.degrees(us)).value, us);
}

TEST(ServoCalibration, HasNoAngleForAServoThatIsOff) {
  EXPECT_FALSE(elbow.degrees(0));
  EXPECT_DOUBLE_EQ(elbow.degrees(2500)->value, 90)
      << "another program may set a pulse outside of the calibration";
}

TEST(ServoCalibration, NeedsTwoEndsThatDiffer) {
  const auto reason = [](End one, End other) {
    return problem_of([&] { ServoCalibration(one, other); }).reason;
  };
  const End low{Microseconds(1000), Degrees(-45)};
  EXPECT_TRUE(contains(reason(low, {Microseconds(1000), Degrees(45)}), "same pulse"));
  EXPECT_TRUE(contains(reason(low, {Microseconds(2000), Degrees(-45)}), "same angle"));
  for (const int wrong : {0, -1, 2501}) {
    EXPECT_TRUE(contains(reason(low, {Microseconds(wrong), Degrees(45)}), "out of range")) << wrong;
  }
}

TEST(Degrees, RefuseValuesThatAreNotFinite) {
  static_assert(Degrees(-30).value == -30);
  for (const double wrong :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    EXPECT_EQ(problem_of([&] { Degrees{wrong}; }).kind, ErrorKind::usage) << wrong;
  }
}

}  // namespace
}  // namespace r4::test
