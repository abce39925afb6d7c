// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/command.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "protocol/messages/command_field.hpp"
#include "tests/support/datagrams.hpp"

namespace r4 {

// gtest prints these names in its messages.
void PrintTo(Refusal refusal, std::ostream* out) { *out << test::str(name_of(refusal)); }

namespace {

using test::str;
using test::with_crc;

// Judges the command in `text` ("O:358,1,1"). A refusal must not change the result.
Refusal command_judged(const std::string& text) {
  Field field;
  EXPECT_TRUE(read_field(text, field)) << text;
  Command command = Command::relay(7, true);
  const Refusal refusal = parse_command(field, command);
  if (refusal != Refusal::none) {
    EXPECT_EQ(command.kind, CommandKind::relay) << text;
    EXPECT_EQ(command.channel, 7) << text;
  }
  return refusal;
}

std::string written(const Command& command) {
  char buffer[max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  write_command(writer, command);
  return writer.ok() ? std::string(buffer, writer.size()) : "refused";
}

// Reads the command in `text` and writes it again. If the command is refused, returns the name of
// the refusal.
std::string again(const std::string& text) {
  Field field;
  EXPECT_TRUE(read_field(text, field)) << text;
  Command command;
  const Refusal refusal = parse_command(field, command);
  return refusal == Refusal::none ? written(command) : str(name_of(refusal));
}

TEST(Command, EveryCommandIsReadAndWrittenAgain) {
  for (const std::string text :
       {"H:ROS2-R4", "O:358,1,1",     "D:4095,0,4",    "S:1500,16",       "R:1,On",
        "R:8,Off",   "E:STOP",        "E:CLEAR",       "E:CLEAR,0",       "E:CLEAR,2147483647",
        "E:LEAVE",   "P:-100,2000,4", "Z:4",           "B:4095,1,0,4",    "B:0,0,1,1",
        "U:400,4",   "F:DEFAULT",     "F:AIN24,OSMC1", "C:recovery,last", "C:rate,100",
        "Q:ID",      "Q:WIRING",      "W:0",           "W:1000",          "W:10,AIN24,ENC1"}) {
    EXPECT_EQ(again(text), text);
  }
  EXPECT_EQ(again("W:1001"), "RANGE");
  EXPECT_EQ(again("W:-1"), "RANGE");
  EXPECT_EQ(again("W:10,"), "FORMAT");
}

TEST(Command, TheTableHasOneRowForEachLetterAndWord) {
  for (const CommandRow& row : command_rows) {
    for (const CommandRow& other : command_rows) {
      const bool apart = row.letter != other.letter ||
                         (row.word != other.word && !row.word.empty() && !other.word.empty());
      EXPECT_TRUE(apart || row.kind == other.kind) << row.letter << str(row.word);
    }
    EXPECT_TRUE(is_command_letter(row.letter)) << row.letter;
    EXPECT_LE(row.most - row.least, 1) << row.letter << ": at most one value may be optional";
  }
}

TEST(Command, AlternativeFormsAreTheSameCommand) {
  EXPECT_EQ(again("R:1,1"), "R:1,On");
  EXPECT_EQ(again("R:1,0"), "R:1,Off");
  for (const std::string on : {"On", "ON", "on", "oN"}) EXPECT_EQ(again("R:2," + on), "R:2,On");
  for (const std::string off : {"Off", "OFF", "off"}) EXPECT_EQ(again("R:2," + off), "R:2,Off");
  EXPECT_EQ(again("P:500,3"), "P:500,1000,3") << "the default speed";
  EXPECT_EQ(again("O:0358,01,01"), "O:358,1,1");
}

TEST(Command, EachFactoryMakesItsCommandText) {
  EXPECT_EQ(written(Command::heartbeat()), "H:ROS2-R4");
  EXPECT_EQ(written(Command::osmc(1, Pwm(358), Direction::forward)), "O:358,1,1");
  EXPECT_EQ(written(Command::dhb12(4, Pwm(4095), Direction::reverse)), "D:4095,0,4");
  EXPECT_EQ(written(Command::servo(16, Microseconds(2500))), "S:2500,16");
  EXPECT_EQ(written(Command::relay(8, true)), "R:8,On");
  EXPECT_EQ(written(Command::relay(1, false)), "R:1,Off");
  EXPECT_EQ(written(Command::stop()), "E:STOP");
  EXPECT_EQ(written(Command::clear()), "E:CLEAR");
  EXPECT_EQ(written(Command::clear(7)), "E:CLEAR,7");
  EXPECT_EQ(command_judged("E:CLEAR,-1"), Refusal::range);
  EXPECT_EQ(command_judged("E:CLEAR,2147483648"), Refusal::range);
  EXPECT_EQ(written(Command::stepper(4, Steps(-2147483647 - 1), StepsPerSecond(20000))),
            "P:-2147483648,20000,4");
  EXPECT_EQ(written(Command::zero(1)), "Z:1");
  EXPECT_EQ(written(Command::bldc(2, Pwm(1), Direction::forward, true)), "B:1,1,1,2");
  EXPECT_EQ(written(Command::proximity(1, Centimetres(0))), "U:0,1");
  EXPECT_EQ(written(Command::fields("DEFAULT,SAFE,CMD")), "F:DEFAULT,SAFE,CMD");
  EXPECT_EQ(written(Command::setting("rate", "50")), "C:rate,50");
  EXPECT_EQ(written(Command::identify()), "Q:ID");
  EXPECT_EQ(written(Command::ask_wiring()), "Q:WIRING");
}

// A command whose first value has a range, and whose text consists of this value and the channel.
struct Ranged {
  const char* letter;
  const char* middle;  // the text between value and channel
  long long min;
  long long max;
  int channels;
  std::string text(const std::string& value, const std::string& channel) const {
    return std::string(letter) + ":" + value + middle + "," + channel;
  }
};
constexpr Ranged ranged[] = {
    {"O", ",1", 0, 4095, 4},
    {"D", ",0", 0, 4095, 4},
    {"S", "", 0, 2500, 16},
    {"B", ",1,0", 0, 4095, 4},
    {"U", "", 0, 400, 4},
    {"P", "", -2147483648LL, 2147483647LL, 4},
    {"P", ",20000", -2147483648LL, 2147483647LL, 4},
};

TEST(Command, AcceptsValuesOnlyWithinTheirRange) {
  for (const Ranged& c : ranged) {
    for (const long long value : {c.min, c.max}) {
      EXPECT_EQ(command_judged(c.text(std::to_string(value), "1")), Refusal::none)
          << c.letter << value;
    }
    for (const std::string& value :
         {std::to_string(c.min - 1), std::to_string(c.max + 1), std::string("4294967296"),
          std::string("18446744073709551616"), std::string("-18446744073709551617")}) {
      EXPECT_EQ(command_judged(c.text(value, "1")), Refusal::range) << c.letter << value;
    }
  }
}

TEST(Command, AcceptsOnlyChannelsOfTheBoard) {
  for (const Ranged& c : ranged) {
    for (int channel = -1; channel <= 17; ++channel) {
      const bool exists = channel >= 1 && channel <= c.channels;
      EXPECT_EQ(command_judged(c.text("0", std::to_string(channel))),
                exists ? Refusal::none : Refusal::channel)
          << c.letter << channel;
    }
    for (const std::string channel :
         {"256", "257", "65537", "4294967297", "99999999999999999999"}) {
      EXPECT_EQ(command_judged(c.text("0", channel)), Refusal::channel) << c.letter << channel;
    }
  }
  for (int channel = -1; channel <= 17; ++channel) {
    const std::string text = std::to_string(channel);
    EXPECT_EQ(command_judged("R:" + text + ",On"),
              channel >= 1 && channel <= 8 ? Refusal::none : Refusal::channel);
    EXPECT_EQ(command_judged("Z:" + text),
              channel >= 1 && channel <= 4 ? Refusal::none : Refusal::channel);
  }
  EXPECT_EQ(command_judged("Z:257"), Refusal::channel);
  EXPECT_EQ(command_judged("R:4294967297,On"), Refusal::channel);
}

TEST(Command, DirectionsBrakesAndSpeedsHaveTheirRange) {
  for (const std::string text :
       {"O:1,2,1", "D:1,2,1", "O:1,-1,1", "D:1,4294967297,1", "B:1,2,0,1", "B:1,0,2,1", "P:1,0,1",
        "P:1,-1,1", "P:1,20001,1", "R:1,2", "R:1,-1", "P:1,4294967297,1"}) {
    EXPECT_EQ(command_judged(text), Refusal::range) << text;
  }
  EXPECT_EQ(command_judged("P:1,1,1"), Refusal::none);
  EXPECT_EQ(command_judged("P:1,20000,1"), Refusal::none);
}

TEST(Command, AWrongNumberOfValuesIsAFormatError) {
  for (const std::string text :
       {"O:1",       "O:1,1",       "O:1,1,1,1",  "D:1,1",       "D:1,1,1,1",
        "S:1",       "S:1,1,1",     "R:1",        "R:1,On,1",    "P:1",
        "P:1,1,1,1", "Z:1,1",       "B:1,1,1",    "B:1,1,1,1,1", "U:1",
        "U:1,1,1",   "C:rate",      "C:rate,1,2", "E:STOP,1",    "E:LEAVE,1",
        "E:CLEAR,",  "E:CLEAR,1,2", "E:CLEAR,x",  "Q:ID,1",      "H:ROS2-R4,1"}) {
    EXPECT_EQ(command_judged(text), Refusal::format) << text;
  }
}

TEST(Command, AnInvalidNumberIsAFormatError) {
  for (const std::string bad : {"", "+5", " 5", "5 ", "x", "5.0", "0x5", "-", "1e3", "5:"}) {
    for (const Ranged& c : ranged) {
      EXPECT_EQ(command_judged(c.text(bad, "1")), Refusal::format) << c.letter << bad;
      EXPECT_EQ(command_judged(c.text("0", bad)), Refusal::format) << c.letter << bad;
    }
    for (const std::string& text :
         {"O:1," + bad + ",1", "D:1," + bad + ",1", "B:1," + bad + ",0,1", "B:1,0," + bad + ",1",
          "P:1," + bad + ",1", "R:" + bad + ",On", "R:1," + bad, "Z:" + bad}) {
      EXPECT_EQ(command_judged(text), Refusal::format) << text;
    }
  }
  for (const std::string text : {"E:", "H:", "Q:", "F:", "C:", "C:,", "C:rate,", "C:,1"}) {
    EXPECT_EQ(command_judged(text), Refusal::format) << text;
  }
}

TEST(Command, OtherLettersAndWordsAreUnknown) {
  for (const std::string text :
       {"X:1", "o:1,1,1", "e:STOP", "N:66,RANGE", "I:R4,a,b,c", "T:1", "A:1", "OO:1,1,1", "PNum:1",
        "1:1", "#:1", "E:stop", "E:STOPP", "E:START", "H:R4-ROS2", "Q:id", "H:x,1"}) {
    EXPECT_EQ(command_judged(text), Refusal::unknown) << text;
  }
}

TEST(Command, ChecksTheFormThenTheChannelThenTheRange) {
  EXPECT_EQ(command_judged("O:9999,x,9"), Refusal::format);
  EXPECT_EQ(command_judged("O:9999,1,9"), Refusal::channel);
  EXPECT_EQ(command_judged("O:9999,1,1"), Refusal::range);
}

TEST(Command, ChecksTheCommandsOfTheFactories) {
  EXPECT_EQ(check_command(Command::osmc(4, Pwm(4095), Direction::forward)), Refusal::none);
  EXPECT_EQ(check_command(Command::osmc(4, Pwm(4096), Direction::forward)), Refusal::range);
  EXPECT_EQ(check_command(Command::osmc(4, Pwm(-1), Direction::forward)), Refusal::range);
  EXPECT_EQ(check_command(Command::osmc(4, Pwm(1), static_cast<Direction>(2))), Refusal::range);
  for (const int channel : {-1, 0, 5, 256, 257, 65537}) {
    EXPECT_EQ(check_command(Command::osmc(channel, Pwm(1), Direction::forward)), Refusal::channel)
        << channel;
    EXPECT_EQ(check_command(Command::dhb12(channel, Pwm(1), Direction::forward)), Refusal::channel)
        << channel;
    EXPECT_EQ(check_command(Command::stepper(channel, Steps(1), StepsPerSecond(1))),
              Refusal::channel)
        << channel;
    EXPECT_EQ(check_command(Command::zero(channel)), Refusal::channel) << channel;
    EXPECT_EQ(check_command(Command::bldc(channel, Pwm(1), Direction::forward, false)),
              Refusal::channel);
    EXPECT_EQ(check_command(Command::proximity(channel, Centimetres(1))), Refusal::channel)
        << channel;
  }
  EXPECT_EQ(check_command(Command::servo(16, Microseconds(2500))), Refusal::none);
  EXPECT_EQ(check_command(Command::servo(16, Microseconds(2501))), Refusal::range);
  EXPECT_EQ(check_command(Command::servo(17, Microseconds(2500))), Refusal::channel);
  EXPECT_EQ(check_command(Command::relay(9, true)), Refusal::channel);
  EXPECT_EQ(check_command(Command::stepper(1, Steps(1), StepsPerSecond(0))), Refusal::range);
  EXPECT_EQ(check_command(Command::stepper(1, Steps(1), StepsPerSecond(20001))), Refusal::range);
  EXPECT_EQ(check_command(Command::proximity(1, Centimetres(401))), Refusal::range);
  EXPECT_EQ(check_command(Command::bldc(1, Pwm(4096), Direction::forward, false)), Refusal::range);
  EXPECT_EQ(check_command(Command::fields("")), Refusal::format);
  EXPECT_EQ(check_command(Command::setting("", "1")), Refusal::format);
  EXPECT_EQ(check_command(Command::setting("rate", "")), Refusal::format);
  for (const Command& command : {Command::heartbeat(), Command::stop(), Command::clear(),
                                 Command::identify(), Command::fields("ALL")}) {
    EXPECT_EQ(check_command(command), Refusal::none);
  }
}

TEST(Command, ADutyIsRoundedToTheNearestPwmAndItsSignIsTheDirection) {
  EXPECT_EQ(written(Command::osmc(1, Duty(1))), "O:4095,1,1");
  EXPECT_EQ(written(Command::osmc(1, Duty(0))), "O:0,1,1");
  EXPECT_EQ(written(Command::dhb12(2, Duty(-0.25))), "D:1024,0,2");
  EXPECT_EQ(written(Command::bldc(3, Duty(0.1), true)), "B:410,1,1,3");
  for (const double wrong : {1.0001, -1.0001, std::numeric_limits<double>::quiet_NaN(),
                             std::numeric_limits<double>::infinity()}) {
    EXPECT_EQ(check_command(Command::osmc(1, Duty(wrong))), Refusal::range) << wrong;
  }
}

template <class... Arguments>
concept MakesServo = requires(Arguments... arguments) {
  Command::servo(arguments...);
};
template <class... Arguments>
concept MakesRelay = requires(Arguments... arguments) {
  Command::relay(arguments...);
};
template <class... Arguments>
concept MakesStepper = requires(Arguments... arguments) {
  Command::stepper(arguments...);
};
static_assert(MakesServo<int, Microseconds>);
static_assert(!MakesServo<Microseconds, int> && !MakesServo<int, int>);
static_assert(MakesRelay<int, bool> && !MakesRelay<bool, int>);
static_assert(MakesStepper<int, Steps, StepsPerSecond>);
static_assert(!MakesStepper<int, StepsPerSecond, Steps>);

TEST(Command, TextsCannotForgeAField) {
  EXPECT_EQ(written(Command::fields("AIN24;E:CLEAR")), "refused");
  EXPECT_EQ(written(Command::setting("rate", "1;E:CLEAR")), "refused");
  EXPECT_EQ(written(Command::setting("rate", "1,2")), "refused");
}

TEST(Command, SevenCommandsDriveOutputs) {
  const std::string driving = "ODSRPBZ";
  for (const std::string text :
       {"O:1,1,1", "D:1,1,1", "S:1,1", "R:1,On", "P:1,1", "B:1,1,1,1", "Z:1", "H:ROS2-R4", "E:STOP",
        "E:CLEAR", "U:1,1", "F:ALL", "C:rate,1", "Q:ID", "Q:WIRING"}) {
    Field field;
    ASSERT_TRUE(read_field(text, field));
    Command command;
    ASSERT_EQ(parse_command(field, command), Refusal::none);
    EXPECT_EQ(drives_output(command.kind), driving.find(text[0]) != std::string::npos) << text;
  }
}

TEST(Command, TheCommandFieldHasAOneLetterName) {
  struct Case {
    const char* fields;
    int count;
    const char* name;
  };
  for (const Case& c :
       {Case{"O:1,0,1;PNum:1;T:2;", 1, "O"}, Case{"PNum:1;T:2;A:0f;O:1,0,1;", 1, "O"},
        Case{"AIN24:1.00;PNum:1;T:2;A:0f;1:2;#:3;", 0, ""}, Case{"O:1,0,1;D:1,0,1;PNum:1;", 2, "O"},
        Case{"x:1;PNum:1;", 1, "x"}, Case{"O:1,0,1;O:1,0,1;E:STOP;", 3, "O"}}) {
    const std::string bytes = with_crc(c.fields);
    Datagram datagram;
    ASSERT_TRUE(read_datagram(bytes, datagram));
    EXPECT_EQ(datagram.command_count(), c.count) << c.fields;
    EXPECT_EQ(str(datagram.command().name()), c.name) << c.fields;
    EXPECT_EQ(str(datagram.command().values()),
              c.count == 0 ? "" : str(datagram.find(Text(c.name, 1)).values()));
  }
}

TEST(Command, AListOfFieldsIsReadAsASet) {
  FieldSet set;
  EXPECT_EQ(parse_fields("DEFAULT", set), Refusal::none);
  EXPECT_EQ(set, FieldSet::paper_default());
  EXPECT_EQ(parse_fields("ALL", set), Refusal::none);
  EXPECT_EQ(set, FieldSet::all());
  EXPECT_EQ(parse_fields("AIN24", set), Refusal::none);
  FieldSet expected;
  expected.add(StateField::ain24);
  EXPECT_EQ(set, expected);
  EXPECT_EQ(parse_fields("SAFE,DEFAULT,CMD,SAFE", set), Refusal::none);
  expected = FieldSet::paper_default();
  expected.add(StateField::safe);
  expected.add(StateField::cmd);
  EXPECT_EQ(set, expected);
  for (const std::string list :
       {"", ",", "AIN24,", ",AIN24", "AIN24,NEW", "ain24", "default", "DEFAULT ALL", "PNum", "T"}) {
    EXPECT_EQ(parse_fields(list, set), Refusal::unknown) << list;
    EXPECT_EQ(set, expected) << list;
  }
}

}  // namespace
}  // namespace r4
