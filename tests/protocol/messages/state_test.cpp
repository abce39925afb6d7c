// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/state.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "protocol/messages/state_fields.hpp"
#include "r4link/tables/state_fields.hpp"
#include "tests/support/datagrams.hpp"

namespace r4 {
namespace {

using test::str;
using test::with_crc;

bool read_fields(const std::string& fields, State& state) {
  const std::string bytes = with_crc(fields);
  Datagram datagram;
  EXPECT_TRUE(read_datagram(bytes, datagram)) << fields;
  return read_state(datagram, state);
}

bool accepts(const std::string& fields) {
  State state;
  return read_fields(fields, state);
}

std::string written(StateField field, const State& state) {
  char buffer[max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  write_field(writer, field, state);
  return {buffer, writer.size()};
}

std::vector<StateField> every_field() {
  std::vector<StateField> fields;
  for (int i = 0; i < state_field_count; ++i) fields.push_back(static_cast<StateField>(i));
  return fields;
}

// All members differ from zero and from each other.
State numbered_state() {
  State state;
  for (int i = 0; i < analog_channels; ++i) state.raw.analog_cv[i] = 1001 + i;
  state.handle = Handle::held;
  for (int i = 0; i < dhb12_channels; ++i) {
    state.raw.dhb12[i] = {static_cast<std::uint16_t>(2001 + i), Direction::forward};
  }
  for (int i = 0; i < osmc_channels; ++i) {
    state.raw.osmc[i] = {static_cast<std::uint16_t>(3001 + i), Direction::forward};
  }
  for (int i = 0; i < stepper_channels; ++i) state.raw.stepper_steps[i] = -(4001 + i);
  for (int i = 0; i < servo_channels; ++i) {
    state.raw.servo_us[i] = static_cast<std::uint16_t>(1501 + i);
  }
  for (int i = 0; i < encoder_channels; ++i) {
    state.raw.encoder_counts[i] = -(5001 + i);
    state.raw.encoder_hz[i] = -(7001 + i);
    state.raw.encoder_index_counts[i] = -(8001 + i);
  }
  for (int i = 0; i < ultrasonic_channels; ++i) {
    state.raw.ultrasonic_cm[i] = static_cast<std::uint16_t>(101 + i);
  }
  for (int i = 0; i < bldc_channels; ++i) {
    state.raw.bldc[i] = {static_cast<std::uint16_t>(6 + i), Direction::forward, true};
  }
  state.relays = 0x81;
  state.safe = SafeReason::proximity;
  state.last_command = 11;
  state.rx_ok = 12;
  state.rx_crc = 13;
  state.rx_lost = 14;
  state.rx_duplicate = 15;
  state.rx_refused = 16;
  state.fault = {64, ChipTrouble::no_acknowledge};
  state.late = 17;
  for (int i = 0; i < i2c_slots; ++i) {
    state.raw.i2c[i].t_ms = static_cast<std::uint32_t>(9001 + i);
    state.raw.i2c[i].errors = static_cast<std::uint32_t>(1 + i);
    state.raw.i2c[i].data.size = 1;
    state.raw.i2c[i].data.bytes[0] = static_cast<std::uint8_t>(0xF1 + i);
  }
  state.i2c_answer.pnum = 18;
  state.i2c_answer.outcome = I2cOutcome::cancelled;
  state.i2c_bus.newest = I2cOutcome::bus_stuck;
  state.i2c_bus.errors = 19;
  state.i2c_bus.recoveries = 20;
  for (int i = 0; i < uart_channels; ++i) {
    UartBytes& uart = state.raw.uart[i];
    uart.position = static_cast<std::uint32_t>(9101 + i);
    uart.lost = static_cast<std::uint32_t>(21 + i);
    uart.data.size = 1;
    uart.data.bytes[0] = static_cast<std::uint8_t>(0xE1 + i);
    state.raw.dac_mv[i] = static_cast<std::uint16_t>(1601 + i);
  }
  state.gpio = 130;
  return state;
}

// Each field of numbered_state() as text, in the order of StateField.
const char* const numbered_fields[] = {
    "AIN24:10.01",     "AIN12:10.02",     "AIN5:10.03",        "AINDMH:10.04",
    "DMHSTA:1",        "AINSTEER:10.05",  "DHB1A:2001,1",      "OSMC1:3001,1",
    "STEP1POS:-4001",  "SERVO1POS:1501",  "AIN6:10.06",        "DHB1B:2002,1",
    "DHB2A:2003,1",    "DHB2B:2004,1",    "OSMC2:3002,1",      "OSMC3:3003,1",
    "OSMC4:3004,1",    "STEP2POS:-4002",  "STEP3POS:-4003",    "STEP4POS:-4004",
    "SERVO2POS:1502",  "SERVO3POS:1503",  "SERVO4POS:1504",    "SERVO5POS:1505",
    "SERVO6POS:1506",  "SERVO7POS:1507",  "SERVO8POS:1508",    "SERVO9POS:1509",
    "SERVO10POS:1510", "SERVO11POS:1511", "SERVO12POS:1512",   "SERVO13POS:1513",
    "SERVO14POS:1514", "SERVO15POS:1515", "SERVO16POS:1516",   "ENC1:-5001",
    "ENC2:-5002",      "ENC3:-5003",      "ENC4:-5004",        "US1:101",
    "US2:102",         "US3:103",         "US4:104",           "BLDC1:6,1,1",
    "BLDC2:7,1,1",     "BLDC3:8,1,1",     "BLDC4:9,1,1",       "RELAYS:129",
    "SAFE:4",          "CMD:11",          "RXOK:12",           "RXCRC:13",
    "RXLOST:14",       "RXDUP:15",        "RXREF:16",          "LATE:17",
    "ENC1HZ:-7001",    "ENC2HZ:-7002",    "ENC3HZ:-7003",      "ENC4HZ:-7004",
    "ENC1IDX:-8001",   "ENC2IDX:-8002",   "ENC3IDX:-8003",     "ENC4IDX:-8004",
    "I2C1:9001,1,xf1", "I2C2:9002,2,xf2", "I2C3:9003,3,xf3",   "I2C4:9004,4,xf4",
    "I2C5:9005,5,xf5", "I2C6:9006,6,xf6", "I2C7:9007,7,xf7",   "I2C8:9008,8,xf8",
    "I2CX:18,3,x",     "I2CBUS:2,19,20",  "UART1:9101,21,xe1", "UART2:9102,22,xe2",
    "DAC1:1601",       "DAC2:1602",       "GPIO:130",          "FAULT:64,1"};

TEST(State, AnUnknownReasonIsReadAsAFault) {
  State state;
  ASSERT_TRUE(read_fields("SAFE:7;", state));
  EXPECT_EQ(state.safe, SafeReason::fault);
}

TEST(State, EveryFieldHasItsOwnMemberAndItsForm) {
  const State state = numbered_state();
  ASSERT_EQ(std::size(numbered_fields), static_cast<std::size_t>(state_field_count));
  for (const StateField field : every_field()) {
    EXPECT_EQ(written(field, state), numbered_fields[static_cast<int>(field)]);
  }
}

TEST(State, EveryFieldIsReadIntoTheMemberItIsWrittenFrom) {
  for (const StateField field : every_field()) {
    const std::string text = numbered_fields[static_cast<int>(field)];
    State state;
    ASSERT_TRUE(read_fields("PNum:1;" + text + ";T:2;", state)) << text;
    EXPECT_EQ(written(field, state), text);
    FieldSet only;
    only.add(field);
    EXPECT_EQ(state.present, only) << text;
    for (const StateField other : every_field()) {
      if (other == field) continue;
      EXPECT_EQ(written(other, state), written(other, State())) << text;
    }
  }
}

TEST(State, TheNumbersOfAFieldMatchItsText) {
  const State state = numbered_state();
  for (const StateField field : every_field()) {
    const std::string text = numbered_fields[static_cast<int>(field)];
    std::istringstream wire(text.substr(text.find(':') + 1));
    const StateNumbers numbers = numbers_of(state, field);
    ASSERT_GE(numbers.count, 1) << text;
    for (int i = 0; i < numbers.count; ++i) {
      std::string value;
      std::getline(wire, value, ',');
      EXPECT_DOUBLE_EQ(numbers[i], std::stod(value)) << text;
    }
  }
}

TEST(State, NumbersAreSetInTheMemberTheyAreReadFrom) {
  const State from = numbered_state();
  for (const StateField field : every_field()) {
    State state;
    const bool has_bytes = kind_row_of(field).has_bytes();
    EXPECT_EQ(set_numbers(state, field, numbers_of(from, field)), !has_bytes);
    EXPECT_TRUE(state.present.empty());
    EXPECT_EQ(written(field, state), written(field, has_bytes ? State() : from));
  }
}

TEST(State, NumbersOutsideTheRangeOfTheirFieldAreNotSet) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  State state;
  EXPECT_TRUE(set_numbers(state, StateField::ain24, {1, {-0.054}}));
  EXPECT_EQ(state.raw.analog_cv[0], -5);
  EXPECT_TRUE(set_numbers(state, StateField::cmd, {1, {4294967295.0}}));
  EXPECT_TRUE(set_numbers(state, StateField::enc1, {1, {-2147483648.0}}));
  EXPECT_TRUE(set_numbers(state, StateField::osmc1, {2, {4095, 1}}));
  const State before = state;
  EXPECT_FALSE(set_numbers(state, StateField::osmc1, {2, {4096, 1}}));
  EXPECT_FALSE(set_numbers(state, StateField::count, {1, {1}}));
  EXPECT_EQ(numbers_of(state, StateField::count).count, 0);
  EXPECT_FALSE(set_numbers(state, StateField::osmc1, {2, {1, 2}}));
  EXPECT_FALSE(set_numbers(state, StateField::osmc1, {1, {1}}));
  EXPECT_FALSE(set_numbers(state, StateField::osmc1, {3, {1, 1, 1}}));
  EXPECT_FALSE(set_numbers(state, StateField::osmc1, {0, {}}));
  EXPECT_FALSE(set_numbers(state, StateField::servo1pos, {1, {-1}}));
  EXPECT_FALSE(set_numbers(state, StateField::ain24, {1, {1e9}}));
  EXPECT_FALSE(set_numbers(state, StateField::cmd, {1, {4294967296.0}}));
  for (const double none : {nan, 1e300, -1e300}) {
    EXPECT_FALSE(set_numbers(state, StateField::enc1, {1, {none}}));
    EXPECT_FALSE(set_numbers(state, StateField::ain24, {1, {none}}));
  }
  for (const StateField field : every_field()) {
    EXPECT_EQ(written(field, state), written(field, before));
  }
}

// The fields of the user's devices are in the second datagram.
TEST(State, AllFieldsFitTwoDatagramsAndRoundTrip) {
  const State state = numbered_state();
  FieldSet own;
  for (const StateField field : every_field()) {
    if (!FieldSet::all().has(field)) own.add(field);
  }
  for (const FieldSet& all : {FieldSet::all(), own}) {
    char buffer[max_datagram];
    DatagramWriter writer(buffer, sizeof buffer);
    for (const StateField field : all) write_field(writer, field, state);
    const std::string bytes = str(writer.finish(4294967295U, 4294967295U));
    ASSERT_FALSE(bytes.empty());
    Datagram datagram;
    ASSERT_TRUE(read_datagram(bytes, datagram));
    State back;
    ASSERT_TRUE(read_state(datagram, back));
    EXPECT_EQ(back.present, all);
    EXPECT_EQ(back.pnum, 4294967295U);
    EXPECT_EQ(back.t_ms, 4294967295U);
    for (const StateField field : all) EXPECT_EQ(written(field, back), written(field, state));
  }
}

TEST(State, ReadsFieldsInAnyOrderAndSkipsUnknownFields) {
  State state;
  ASSERT_TRUE(read_fields(
      "OSMC1:400,1;NEW:x;T:7;SAFE:2;Z9:;AIN24:1.50;PNum:3;ain24:x;SERVO17POS:99;A:sig;", state));
  FieldSet expected;
  expected.add(StateField::osmc1);
  expected.add(StateField::safe);
  expected.add(StateField::ain24);
  EXPECT_EQ(state.present, expected);
  EXPECT_EQ(state.raw.osmc[0], (Drive{400, Direction::forward}));
  EXPECT_EQ(state.safe, SafeReason::stop);
  EXPECT_EQ(state.raw.analog_cv[0], 150);
  EXPECT_EQ(state.pnum, 3U);
  EXPECT_EQ(state.t_ms, 7U);
}

TEST(State, MissingFieldsKeepTheirValues) {
  State state = numbered_state();
  ASSERT_TRUE(read_fields("PNum:1;T:2;RELAYS:3;", state));
  EXPECT_EQ(state.relays, 3);
  EXPECT_EQ(state.raw.osmc[3].pwm, 3004);
  ASSERT_TRUE(read_fields("RELAYS:4;", state));
  EXPECT_EQ(state.pnum, 1U);
  EXPECT_EQ(state.t_ms, 2U);
}

TEST(State, AcceptsValuesUpToTheLimitsOfTheirRange) {
  for (const char* fields : {"AIN24:-19999999.99;",
                             "AIN24:19999999.99;",
                             "DMHSTA:0;",
                             "DHB1A:0,0;",
                             "DHB2B:4095,1;",
                             "OSMC4:4095,0;",
                             "STEP1POS:2147483647;",
                             "STEP4POS:-2147483648;",
                             "SERVO1POS:0;",
                             "SERVO16POS:2500;",
                             "ENC4:-2147483648;",
                             "US1:0;",
                             "US4:65535;",
                             "BLDC4:4095,0,1;",
                             "RELAYS:0;",
                             "RELAYS:255;",
                             "SAFE:6;",
                             "CMD:4294967295;",
                             "LATE:4294967295;",
                             "ENC1HZ:-2147483648;",
                             "ENC4IDX:2147483647;",
                             "FAULT:0,0;",
                             "FAULT:127,255;",
                             "T:4294967295;"}) {
    EXPECT_TRUE(accepts(fields)) << fields;
  }
}

TEST(State, AnInvalidValueRefusesTheWholeDatagram) {
  for (const std::string field : {"AIN24:",
                                  "AIN24:x",
                                  "AIN24:1,2",
                                  "AIN24:+1.00",
                                  "AIN24: 1.00",
                                  "AIN24:20000000.00",
                                  "DMHSTA:3",
                                  "DMHSTA:",
                                  "DMHSTA:1,1",
                                  "DHB1A:4096,1",
                                  "DHB1A:1,2",
                                  "DHB1A:-1,1",
                                  "DHB1A:1",
                                  "DHB1A:1,",
                                  "DHB1A:,1",
                                  "DHB1A:1,1,1",
                                  "OSMC1:65536,1",
                                  "OSMC1:4294967296,1",
                                  "STEP1POS:2147483648",
                                  "STEP1POS:1.0",
                                  "SERVO1POS:2501",
                                  "SERVO1POS:-1",
                                  "ENC1:",
                                  "ENC1HZ:1.5",
                                  "ENC4IDX:2147483648",
                                  "US1:65536",
                                  "US1:-1",
                                  "BLDC1:4096,1,1",
                                  "FAULT:128,1",
                                  "FAULT:64",
                                  "FAULT:64,256",
                                  "FAULT:64,1,1",
                                  "BLDC1:1,2,1",
                                  "BLDC1:1,1,2",
                                  "BLDC1:1,1",
                                  "BLDC1:1,1,1,1",
                                  "RELAYS:256",
                                  "SAFE:-1",
                                  "CMD:4294967296",
                                  "CMD:-1",
                                  "RXOK:x"}) {
    State state = numbered_state();
    state.pnum = 77;
    EXPECT_FALSE(read_fields("RELAYS:7;PNum:1;" + field + ";T:2;", state)) << field;
    EXPECT_EQ(state.relays, 0x81) << "partly applied: " << field;
    EXPECT_EQ(state.pnum, 77U) << field;
  }
  EXPECT_FALSE(accepts("AIN24:1.00;T:4294967296;")) << "the clock of the board has 32 bits";
}

TEST(State, ARefusedDatagramChangesNoField) {
  const State before = numbered_state();
  for (const StateField field : every_field()) {
    if (field == StateField::enc1) continue;
    State state = before;
    const std::string zero = written(field, State());
    EXPECT_FALSE(read_fields(zero + "ENC1:x;", state)) << zero;
    for (const StateField each : every_field()) {
      EXPECT_EQ(written(each, state), written(each, before)) << zero;
    }
  }
}

TEST(State, ADuplicateFieldRefusesTheWholeDatagram) {
  EXPECT_FALSE(accepts("AIN24:1.00;AIN24:1.00;"));
  EXPECT_FALSE(accepts("OSMC1:1,1;AIN24:1.00;OSMC1:1,1;"));
  EXPECT_TRUE(accepts("NEW:1;NEW:1;")) << "unknown fields are ignored";
}

TEST(State, AnEmptyDatagramHasNoFields) {
  State state = numbered_state();
  EXPECT_TRUE(read_state(Datagram(), state));
  EXPECT_TRUE(state.present.empty());
}

TEST(State, FindsOnlyExactFieldNames) {
  std::set<std::string> names;
  for (const StateField field : every_field()) {
    const std::string name = str(name_of(field));
    EXPECT_EQ(state_field(name), field) << name;
    names.insert(name);
    for (const std::string& other : {name + "X", "X" + name, name.substr(1), name + " "}) {
      const StateField found = state_field(other);
      EXPECT_TRUE(found == StateField::count || str(name_of(found)) == other) << other;
    }
  }
  EXPECT_EQ(names.size(), static_cast<std::size_t>(state_field_count)) << "every name occurs once";
  for (const std::string name : {"", "PNum", "T", "ain24", "SERVO17POS", "SERVO0POS"}) {
    EXPECT_EQ(state_field(name), StateField::count) << name;
  }
  EXPECT_EQ(state_field(std::string(1000, 'A')), StateField::count);
  EXPECT_EQ(state_field(Text()), StateField::count);
}

TEST(State, ThePapersSetIsTheFirstTenFields) {
  const FieldSet paper = FieldSet::paper_default();
  for (const StateField field : every_field()) {
    EXPECT_EQ(paper.has(field), static_cast<int>(field) < 10);
    EXPECT_EQ(FieldSet::all().has(field), field < StateField::i2c1);
  }
  FieldSet set = FieldSet::all();
  for (const StateField field : every_field()) set.remove(field);
  EXPECT_TRUE(set.empty());
  set.add(paper);
  EXPECT_EQ(set, paper);
  EXPECT_NE(set, FieldSet::all());
}

TEST(State, ASetGivesItsFieldsInTheOrderOfTheTable) {
  FieldSet set;
  for (const StateField field : set) FAIL() << str(name_of(field));
  for (const StateField field :
       {StateField::enc4idx, StateField::late, StateField::cmd, StateField::ain24}) {
    set.add(field);
  }
  std::vector<StateField> fields;
  for (const StateField field : set) fields.push_back(field);
  EXPECT_EQ(fields, (std::vector<StateField>{StateField::ain24, StateField::cmd, StateField::late,
                                             StateField::enc4idx}));
  fields.clear();
  FieldSet every;
  for (const StateField field : every_field()) every.add(field);
  for (const StateField field : every) fields.push_back(field);
  EXPECT_EQ(fields, every_field());
}

TEST(State, IsReadByTheNamesOfItsChannels) {
  State state;
  state.raw.analog_cv[static_cast<int>(Analog::ain6)] = 512;
  state.raw.encoder_counts[3] = -7;
  state.raw.stepper_steps[0] = 1000;
  state.raw.ultrasonic_cm[1] = 42;
  state.raw.osmc[3] = {pwm_max, Direction::reverse};
  state.raw.dhb12[1].pwm = 20;
  state.raw.bldc[0] = {pwm_max, Direction::forward, true};
  state.raw.servo_us[15] = 1500;
  state.raw.encoder_hz[1] = -16;
  state.raw.encoder_index_counts[2] = 8;
  state.raw.dac_mv[1] = 1650;
  state.relays = 0x81;
  EXPECT_DOUBLE_EQ(state.volts(Analog::ain6), 5.12);
  EXPECT_EQ(state.encoder(4), -7);
  EXPECT_EQ(state.steps(1), 1000);
  EXPECT_EQ(state.distance_cm(2), 42);
  EXPECT_EQ(state.osmc(4).duty(), -1);
  EXPECT_EQ(state.dhb12(2).pwm, 20);
  EXPECT_EQ(state.bldc(1).duty(), 1);
  EXPECT_EQ(state.servo_us(16), 1500);
  EXPECT_EQ(state.encoder_hz(2), -16);
  EXPECT_EQ(state.encoder_index(3), 8);
  EXPECT_EQ(state.dac_mv(2), 1650);
  EXPECT_TRUE(state.relay(1) && state.relay(8));
  EXPECT_FALSE(state.relay(2));
  for (const int none : {-1, 0, 9}) {
    EXPECT_EQ(state.encoder(none) + state.steps(none) + state.distance_cm(none), 0) << none;
    EXPECT_EQ(state.osmc(none), Drive()) << none;
    EXPECT_FALSE(state.relay(none)) << none;
  }
  EXPECT_EQ(state.volts(Analog::count), 0);
}

}  // namespace
}  // namespace r4
