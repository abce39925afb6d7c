// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/messages/packed_form.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include "protocol/messages/settings.hpp"
#include "protocol/messages/state_fields.hpp"
#include "r4link/state.hpp"
#include "r4link/vocabulary.hpp"
#include "tests/support/datagrams.hpp"
#include "transports/framing/can/packed_layout.hpp"
#include "transports/framing/can/packed_words.hpp"

namespace r4 {
namespace {

using test::paper_capture;
using test::str;
using test::with_crc;
using Bytes = std::vector<std::uint8_t>;

// Empty if the datagram is sent as plain text.
Bytes packed_bytes(const std::string& datagram, std::size_t capacity = max_datagram) {
  Bytes bytes(max_datagram, 0xEE);
  bytes.resize(pack(datagram, bytes.data(), capacity));
  return bytes;
}

std::string unpacked(const Bytes& bytes) {
  char out[max_datagram];
  const UnpackResult result = unpack(bytes.data(), bytes.size(), out, sizeof out);
  return result ? std::string(out, result.size) : std::string("error: ") + to_text(result.error);
}

std::string hex(const Bytes& bytes) {
  std::string text;
  for (const std::uint8_t byte : bytes) text += fmt::format("{:02x}", byte);
  return text;
}

// The number of classic frames in ISO-TP: one frame for up to 7 bytes, otherwise 6 bytes in the
// first frame and 7 bytes in each further frame.
std::size_t frames(std::size_t size) { return size <= 7 ? 1 : 1 + (size - 6 + 6) / 7; }

std::string fields_of(FieldSet set, const State& state) {
  char buffer[max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  for (const StateField field : set) write_field(writer, field, state);
  return str(writer.finish(state.pnum, state.t_ms));
}

// A state of a busy board, a day after power-up.
State busy_state() {
  State state;
  const std::int32_t volts[] = {2631, 1207, 503, 1198, 97, 330};
  std::copy(std::begin(volts), std::end(volts), state.raw.analog_cv);
  state.handle = Handle::held;
  for (int i = 0; i < 4; ++i) {
    state.raw.dhb12[i] = {static_cast<std::uint16_t>(4095 - i), Direction::forward};
    state.raw.osmc[i] = {static_cast<std::uint16_t>(358 * i), Direction::reverse};
    state.raw.stepper_steps[i] = -20000 * (i + 1);
    state.raw.encoder_counts[i] = 1234567 * (i - 1);
    state.raw.encoder_hz[i] = 4000 * (i - 1);
    state.raw.encoder_index_counts[i] = 1234000 * (i - 1);
    state.raw.ultrasonic_cm[i] = static_cast<std::uint16_t>(30 * i);
    state.raw.bldc[i] = {static_cast<std::uint16_t>(1000 * i), Direction::forward, i % 2 == 0};
  }
  for (int i = 0; i < servo_channels; ++i)
    state.raw.servo_us[i] = static_cast<std::uint16_t>(1500 + i);
  state.relays = 0x81;
  state.last_command = 0x8123ABCDU;
  state.rx_ok = 864123;
  state.rx_crc = 3;
  state.rx_lost = 17;
  state.pnum = 8640123;
  state.t_ms = 4012345670U;
  return state;
}

// --- the capture

TEST(PackedForm, RestoresEveryCapturedStateFrom25Bytes) {
  std::vector<std::size_t> states;
  for (const test::CapturedLine& line : paper_capture()) {
    const Bytes bytes = packed_bytes(line.bytes);
    ASSERT_FALSE(bytes.empty()) << line.bytes;
    EXPECT_TRUE(is_packed(bytes[0]));
    EXPECT_FALSE(is_packed(static_cast<std::uint8_t>(line.bytes[0])));
    EXPECT_EQ(unpacked(bytes), line.bytes);
    if (line.bytes.starts_with("AIN24")) states.push_back(bytes.size());
  }
  ASSERT_EQ(states.size(), 62U);
  std::sort(states.begin(), states.end());
  fmt::print("captured states: median {}, at most {} bytes = {} classic frames\n",
             states[states.size() / 2], states.back(), frames(states.back()));
  EXPECT_LE(states[states.size() / 2], 48U);  // the documented limit
  EXPECT_EQ(states.back(), 25U);              // the actual size
}

TEST(PackedForm, MatchesTheDocumentedExampleByteForByte) {
  EXPECT_EQ(hex(packed_bytes(test::captured_state())),
            "911d0a134f297c4bc2004bb10671fff03212c77d0ff07cfd9a");
}

// --- the size of every kind of datagram

TEST(PackedForm, EveryKindOfDatagramIsCompact) {
  const State state = busy_state();
  FieldSet ours = FieldSet::paper_default();
  ours.add(StateField::safe);
  ours.add(StateField::cmd);
  FieldSet more = ours;
  for (const StateField field : {StateField::enc1, StateField::enc2, StateField::us1}) {
    more.add(field);
  }
  State extreme = state;
  for (std::int32_t& steps : extreme.raw.stepper_steps) steps = -2147483647 - 1;
  extreme.pnum = extreme.t_ms = extreme.last_command = 0xFFFFFFFFU;
  struct Case {
    const char* what;
    std::string datagram;
    std::size_t size;
  };
  const Case cases[] = {
      {"state, default", fields_of(FieldSet::paper_default(), state), 28},
      {"state, default, SAFE, CMD", fields_of(ours, state), 33},
      {"  with the largest numbers", fields_of(ours, extreme), 36},
      {"  and ENC1, ENC2, US1", fields_of(more, state), 43},
      {"state, ALL", fields_of(FieldSet::all(), state), 138},
      {"a reading of 14 bytes",
       with_crc("I2C1:1677667715,0,x000000004000f0b0000000000000;PNum:8640123;T:4012345670;"), 33},
      {"  as none of its form", with_crc("I2C1:1,01,xA0;PNum:8640123;T:4012345670;"), 20},
      {"board heartbeat", with_crc("H:R4-ROS2;PNum:8640123;T:4012345670;"), 12},
      {"board heartbeat, safe", with_crc("H:R4-ROS2;PNum:8640123;T:4012345670;SAFE:1;"), 14},
      {"board heartbeat, connecting", "H:R4-ROS2;PNum:0;T:0;^0xb10b3a06^", 5},
      {"host heartbeat", with_crc("H:ROS2-R4;SID:fedcba9876543210;PNum:2523456789;T:4012345670;"),
       21},
      {"paper's host heartbeat", "H:ROS2-R4;T:79201;^0xf390d9ad^", 12},
      {"O:358,1,1", with_crc("O:358,1,1;SID:fedcba9876543210;PNum:2523456789;"), 22},
      {"paper's O:358,1,1", "O:358,1,1;PNum:66;T:1699276044383;^0x7fefae81^", 18},
      {"four wheels, a group",
       with_crc("O:358,1,1;O:358,1,2;O:358,1,3;O:358,1,4;SID:fedcba9876543210;PNum:2523456789;"),
       37},
      {"R:2,On", with_crc("R:2,On;SID:fedcba9876543210;PNum:2523456789;"), 21},
      {"E:STOP", with_crc("E:STOP;SID:fedcba9876543210;PNum:2523456789;"), 20},
      {"F:DEFAULT,SAFE,CMD", with_crc("F:DEFAULT,SAFE,CMD;SID:fedcba9876543210;PNum:2523456789;"),
       24},
      {"C:pack,1", with_crc("C:pack,1;SID:fedcba9876543210;PNum:2523456789;"), 21},
      {"Q:ID", with_crc("Q:ID;SID:fedcba9876543210;PNum:2523456789;"), 20},
      {"N:2523456789,RANGE",
       with_crc("N:2523456789,RANGE;SID:fedcba9876543210;PNum:8640123;T:4012345670;"), 30},
      {"I:R4,0.1.0,sim-1,sim", with_crc("I:R4,0.1.0,sim-1,sim;PNum:8640123;T:4012345670;"), 26},
  };
  fmt::print("{:<30} {:>6} {:>6} {:>7} {:>7}\n", "", "plain", "packed", "frames", "frames");
  for (const Case& each : cases) {
    const Bytes bytes = packed_bytes(each.datagram);
    fmt::print("{:<30} {:>6} {:>6} {:>7} {:>7}\n", each.what, each.datagram.size(), bytes.size(),
               frames(each.datagram.size()), frames(bytes.size()));
    EXPECT_EQ(unpacked(bytes), each.datagram);
    EXPECT_EQ(bytes.size(), each.size) << each.what;
  }
}

TEST(PackedForm, RestoresDeviceBytes) {
  for (std::size_t count = 0; count <= 66; ++count) {
    std::string bytes;
    for (std::size_t i = 0; i < count; ++i) bytes += "0f";
    const std::string datagram =
        with_crc("I2C8:4294967295," + std::to_string(count) + ",x" + bytes + ";PNum:1;T:2;");
    const Bytes packed = packed_bytes(datagram);
    EXPECT_EQ(unpacked(packed), datagram) << count;
    if (count <= packed::most_device_bytes) {
      EXPECT_LE(packed.size(), count + 25);
    }
  }
}

// --- the table

TEST(PackedForm, TableHasEveryNameAndWordOfTheProtocol) {
  const auto known = [](const std::string& word) {
    return packed::code_of(word) != packed::no_word;
  };
  for (int i = 0; i < state_field_count; ++i) {
    const Text name = name_of(static_cast<StateField>(i));
    const unsigned code = packed::code_of(name);
    if (!known(str(name))) {
      EXPECT_FALSE(FieldSet::all().has(static_cast<StateField>(i))) << str(name);
      continue;
    }
    if (i < static_cast<int>(packed::state_words)) {
      EXPECT_EQ(code, static_cast<unsigned>(i))
          << str(name) << "the code must be the index in the table";
    }
    EXPECT_EQ(packed::words[code].form == PackedForm::text,
              name == Text("FAULT") || name == Text("I2CBUS"))
        << str(name);
  }
  for (const char letter : std::string("ODSREPZBUFCQHNIX")) {
    EXPECT_TRUE(known(std::string(1, letter))) << letter;
  }
  for (unsigned code = 1; code <= static_cast<unsigned>(Refusal::full); ++code) {
    EXPECT_TRUE(known(str(name_of(static_cast<Refusal>(code)))));
  }
  for (const std::string word :
       {"PNum",      "T",       "A",        "AN",    "R4-ROS2", "ROS2-R4", "On", "SID",
        "LEAVE",     "Off",     "STOP",     "CLEAR", "DEFAULT", "ALL",     "ID", "rate",
        "heartbeat", "timeout", "recovery", "last",  "rearm",   "pack"}) {
    EXPECT_TRUE(known(word)) << word;
  }
}

TEST(PackedForm, EveryWordHasOneCode) {
  std::set<std::string> seen;
  for (unsigned code = 0; code < packed::word_count; ++code) {
    const std::string word = str(packed::words[code].word());
    EXPECT_TRUE(seen.insert(word).second) << word;
    EXPECT_EQ(packed::code_of(word), code) << word;
  }
  for (const std::string word : {"", "AIN", "AIN244", "SERVO17POS", "SERVO10POSX", "x"}) {
    EXPECT_EQ(packed::code_of(word), packed::no_word) << word;
  }
}

// --- datagrams that are sent as plain text

TEST(PackedForm, SendsANonCanonicalDatagramAsText) {
  const std::string good = "O:358,1,1;PNum:66;T:1699276044383;";
  for (const std::string& datagram : {std::string(),
                                      std::string("O"),
                                      good,
                                      good + "^",
                                      good + "^0x^",
                                      good + "^0x7fefae81",
                                      good + "^0X7fefae81^",
                                      good + "^0x7FEFAE81^",
                                      good + "^0x07efae81^",
                                      good + "^0x00^",
                                      good + "^0x7fefae811^",
                                      good + "0x7fefae81^",
                                      good + "^0x7fefae81^\r\n",
                                      std::string("^0x7fefae81^"),
                                      ";" + good + "^0x7fefae81^",
                                      "\x81:1;" + good + "^0x7fefae81^",
                                      "a b:1;" + good + "^0x7fefae81^",
                                      good + "a:^;^0x7fefae81^",
                                      "ANameOf15Bytes_:1;" + good + "^0x7fefae81^",
                                      good + std::string(1024, 'x')}) {
    EXPECT_TRUE(packed_bytes(datagram).empty()) << datagram;
  }
  EXPECT_FALSE(packed_bytes(good + "^0x7fefae81^").empty());
  EXPECT_FALSE(packed_bytes("ANameOf14Bytes:1;" + good + "^0x7fefae81^").empty());
}

TEST(PackedForm, SendsADatagramAsTextIfPackingDoesNotShortenIt) {
  EXPECT_TRUE(packed_bytes("abc:def;^0x1^").empty());
  EXPECT_TRUE(packed_bytes("a:" + std::string(900, 'x') + ";^0x1^").empty());
}

TEST(PackedForm, DoesNotOverrunATooSmallBuffer) {
  for (const test::CapturedLine& line : {paper_capture()[0], paper_capture()[6]}) {
    const std::size_t size = packed_bytes(line.bytes).size();
    for (std::size_t capacity = 0; capacity < size + 3; ++capacity) {
      Bytes buffer(max_datagram, 0xEE);
      EXPECT_EQ(pack(line.bytes, buffer.data(), capacity), capacity < size ? 0 : size);
      EXPECT_TRUE(std::all_of(buffer.begin() + static_cast<std::ptrdiff_t>(capacity), buffer.end(),
                              [](std::uint8_t byte) { return byte == 0xEE; }));
    }
  }
}

// --- limits of values

TEST(PackedForm, RestoresValuesAtTheLimitsOfTheirForms) {
  const std::string long_enough = "AIN6:1.00;RXOK:100000000;RXLOST:100000000;RXDUP:1000000;";
  for (const std::string field : {"AIN24:0.00",
                                  "AIN24:38.39",
                                  "AIN24:38.40",
                                  "AIN24:-0.01",
                                  "AIN24:00.01",
                                  "AIN24:1.0",
                                  "AIN24:1.000",
                                  "AIN24:.50",
                                  "AIN24:1",
                                  "AIN24:",
                                  "AIN24:1.00,2",
                                  "AIN24:1.2.3",
                                  "AIN24:-1.00",
                                  "DMHSTA:0",
                                  "DMHSTA:14",
                                  "DMHSTA:15",
                                  "DMHSTA:00",
                                  "DMHSTA:-1",
                                  "DMHSTA:1,0",
                                  "DHB1A:0,0",
                                  "DHB1A:30719,1",
                                  "DHB1A:30720,0",
                                  "DHB1A:1,2",
                                  "DHB1A:01,1",
                                  "DHB1A:,1",
                                  "DHB1A:1,",
                                  "DHB1A:1,1,1",
                                  "DHB1A:18446744073709551615,1",
                                  "BLDC1:15359,1,1",
                                  "BLDC1:15360,0,0",
                                  "BLDC1:0,0,1",
                                  "BLDC1:1,1",
                                  "BLDC1:1,1,1,1",
                                  "STEP1POS:-1",
                                  "STEP1POS:-0",
                                  "STEP1POS:0",
                                  "STEP1POS:-",
                                  "STEP1POS:2147483647",
                                  "STEP1POS:-2147483648",
                                  "STEP1POS:36028797018963967",
                                  "STEP1POS:36028797018963968",
                                  "STEP1POS:-36028797018963968",
                                  "STEP1POS:-36028797018963969",
                                  "STEP1POS:72057594037927935",
                                  "SERVO1POS:3839",
                                  "SERVO1POS:3840",
                                  "CMD:0",
                                  "CMD:4294967295",
                                  "CMD:72057594037927935",
                                  "CMD:72057594037927936",
                                  "CMD:18446744073709551616",
                                  "CMD:007",
                                  "SAFE:6",
                                  "T:0",
                                  "T:17592186044415",
                                  "T:17592186044416",
                                  "T:18446744073709551615",
                                  "PNum:4294967295",
                                  "PNum:4294967296",
                                  "PNum:01",
                                  "H:R4-ROS2",
                                  "F:ALL,STOP,On,x,R4-ROS2,",
                                  "Q:,,",
                                  "I:a12b123c1,1a,-.5,sim-1"}) {
    for (const std::string& fields :
         {field + ";" + long_enough, long_enough + field + ";",
          long_enough + field + ";PNum:1;T:2;", long_enough + "PNum:7;" + field + ";"}) {
      const Bytes bytes = packed_bytes(with_crc(fields));
      ASSERT_FALSE(bytes.empty()) << fields;
      EXPECT_EQ(unpacked(bytes), with_crc(fields));
    }
  }
}

// --- any datagram

rc::Gen<std::string> text_of(const std::string& alphabet, int min_size, int max_size) {
  return rc::gen::mapcat(rc::gen::inRange(min_size, max_size + 1), [=](int size) {
    return rc::gen::container<std::string>(static_cast<std::size_t>(size),
                                           rc::gen::elementOf(alphabet));
  });
}

std::string printable_but(const std::string& except) {
  std::string bytes;
  for (char c = ' '; c <= '~'; ++c) {
    if (except.find(c) == std::string::npos) bytes += c;
  }
  return bytes;
}

rc::Gen<std::string> any_word() {
  return rc::gen::map(rc::gen::inRange(0U, packed::word_count),
                      [](unsigned code) { return str(packed::words[code].word()); });
}

rc::Gen<std::string> any_name() {
  return rc::gen::weightedOneOf<std::string>(
      {{8, any_word()}, {1, text_of(printable_but(" :;,^"), 1, 16)}});
}

rc::Gen<std::string> any_values() {
  return rc::gen::oneOf(
      text_of("0123456789", 1, 5), text_of("0123456789", 1, 21), text_of("0123456789.-,", 0, 12),
      text_of("01,", 1, 6), text_of(printable_but(";^"), 0, 20), text_of("ab12-.,", 0, 40),
      any_word(),
      rc::gen::map(rc::gen::pair(any_word(), any_word()),
                   [](const auto& pair) { return pair.first + ',' + pair.second; }),
      rc::gen::map(rc::gen::pair(text_of("0123456789", 1, 3), text_of("0123456789", 2, 2)),
                   [](const auto& pair) { return pair.first + '.' + pair.second; }));
}

// Most datagrams begin or end with fields that have a layout.
rc::Gen<std::string> any_datagram() {
  return rc::gen::exec([] {
    static const std::string captured = test::captured_state();
    static const std::string defaults = captured.substr(0, captured.find("PNum"));
    static const std::string all = fields_of(FieldSet::all(), busy_state());
    std::string fields = *rc::gen::elementOf(std::vector<std::string>{
        "", "", "", defaults, defaults + "SAFE:2;", defaults + "SAFE:0;CMD:77;",
        all.substr(0, all.find("PNum")), "H:R4-ROS2;", "H:ROS2-R4;PNum:12;T:345;",
        "H:ROS2-R4;SID:fedcba9876543210;PNum:12;T:345;",
        "H:ROS2-R4;SID:FEDCBA9876543210;PNum:1;T:3;"});
    const int count = *rc::gen::inRange(0, 12);
    for (int i = 0; i < count; ++i) fields += *any_name() + ':' + *any_values() + ';';
    if (*rc::gen::inRange(0, 3) == 0) {
      fields += fmt::format("SID:{:016x};PNum:{};", *rc::gen::arbitrary<std::uint64_t>(),
                            *rc::gen::arbitrary<std::uint32_t>());
    } else if (*rc::gen::inRange(0, 3) != 0) {
      fields += fmt::format("PNum:{};T:{};", *rc::gen::arbitrary<std::uint32_t>(),
                            *rc::gen::arbitrary<std::uint64_t>() >> *rc::gen::inRange(0, 64));
    }
    if (fields.empty()) fields = "A:1;";
    while (with_crc(fields).size() > max_datagram) {
      fields.pop_back();
      fields.resize(fields.rfind(';') + 1);
    }
    return with_crc(fields);
  });
}

RC_GTEST_PROP(PackedForm, AnyDatagramComesBackByteForByteOrTravelsPlain, ()) {
  for (int round = 0; round < 20; ++round) {
    const std::string datagram = *any_datagram();
    const Bytes bytes = packed_bytes(datagram);
    if (bytes.empty()) continue;
    RC_ASSERT(bytes.size() < datagram.size());
    RC_ASSERT(unpacked(bytes) == datagram);
  }
}

// --- any bytes

RC_GTEST_PROP(PackedForm, AnyBytesUnpackSafelyToTheGrammarOrARefusal, ()) {
  Bytes bytes = *rc::gen::arbitrary<Bytes>();
  if (!bytes.empty()) bytes[0] |= 0x80U;
  const auto capacity = static_cast<std::size_t>(*rc::gen::inRange(0, 200));
  std::string out(capacity + 8, '#');
  const UnpackResult result = unpack(bytes.data(), bytes.size(), out.data(), capacity);
  RC_ASSERT(out.substr(capacity) == "########");
  RC_ASSERT(result.size <= capacity);
  RC_ASSERT(static_cast<bool>(result) == (result.size != 0));
  if (!result) return;
  // If PNum and T are in range, the result with the right checksum is a datagram.
  out.resize(result.size);
  Datagram datagram;
  const ReadResult read_result = read_datagram(out, datagram);
  RC_ASSERT(read_result.error != ReadError::length);
  if (read_result.error == ReadError::syntax) {
    RC_ASSERT(out.find("PNum:") != std::string::npos || out.find("T:") != std::string::npos ||
              out.find("SID:") != std::string::npos);
  }
}

TEST(PackedForm, RefusesMalformedBytesWithAReason) {
  const auto error = [](const Bytes& bytes, std::size_t capacity = max_datagram) {
    char out[max_datagram];
    return unpack(bytes.data(), bytes.size(), out, capacity).error;
  };
  const Bytes good = packed_bytes(test::captured_state());
  EXPECT_EQ(error({}), UnpackError::length);
  EXPECT_EQ(error({0x90, 0, 0}), UnpackError::length);
  EXPECT_EQ(error(Bytes(max_datagram + 1, 0x90)), UnpackError::length);
  EXPECT_EQ(error(good, test::captured_state().size() - 1), UnpackError::length);
  EXPECT_EQ(error(good, test::captured_state().size()), UnpackError::none);
  EXPECT_EQ(error({'O', ':', '1', ',', '0', ',', '1'}), UnpackError::version);
  EXPECT_EQ(error({0xC0, 0, 0, 0, 0, 0}), UnpackError::version);
  EXPECT_EQ(error({0xB8, 0, 0, 0, 0, 0}), UnpackError::syntax);  // has a session, but is too short
  EXPECT_EQ(error({0x80, 0, 0, 0, 0}), UnpackError::syntax);     // no field
  EXPECT_EQ(error({0x81, 0x3B, 0x1D, 0, 0, 0, 0}), UnpackError::syntax);  // a size without numbers
  EXPECT_EQ(error({0x80, 0x3B, 0x1D, 0, 0, 0, 0}), UnpackError::none);    // O:1
  EXPECT_EQ(error({0x80, 0x3B, 0x11, 0, 0, 0, 0}), UnpackError::syntax);  // a text without an end
  EXPECT_EQ(error({0x80, 0x72, 0x1D, 0, 0, 0, 0}), UnpackError::syntax);  // an unknown code
  EXPECT_EQ(error({0x80, 0x3B, 0xE1, 0x3B, 0xDF, 0, 0, 0, 0}), UnpackError::syntax);  // a ';'
  EXPECT_EQ(error({0x80, 0x3B, 0xE1, 0x78, 0xDF, 0, 0, 0, 0}), UnpackError::none);    // an 'x'
  EXPECT_EQ(error({0x80, 0x3B, 0xE1, 0x78, 0xD0, 0, 0, 0, 0}), UnpackError::syntax);  // the filler
  EXPECT_EQ(error(Bytes(good.begin(), good.end() - 1)), UnpackError::syntax);
}

TEST(PackedForm, NeverUnpacksToMoreThanADatagram) {
  Bytes bytes{0x80, 0x44};                                                   // F:
  while (bytes.size() < 600) bytes.insert(bytes.end(), {0xF1, 0xEF, 0x1E});  // SERVO12POS
  char out[max_datagram];
  EXPECT_EQ(unpack(bytes.data(), bytes.size(), out, sizeof out).error, UnpackError::length);
}

// --- damage

// The result of unpacking damaged bytes.
enum class Fate { refused, same, other };
Fate fate_of(const Bytes& damaged, const std::string& original) {
  char out[max_datagram];
  const UnpackResult result = unpack(damaged.data(), damaged.size(), out, sizeof out);
  if (!result) return Fate::refused;
  if (Text(out, result.size) == Text(original)) return Fate::same;
  Datagram datagram;
  return read_datagram(Text(out, result.size), datagram) ? Fate::other : Fate::refused;
}

TEST(PackedForm, DetectsOneOrTwoDamagedBits) {
  int same = 0;
  int tried = 0;
  for (const std::string& line :
       {paper_capture()[0].bytes, paper_capture()[6].bytes, paper_capture()[13].bytes,
        paper_capture()[15].bytes, with_crc("F:DEFAULT,SAFE,CMD;PNum:2523456789;T:4012345670;")}) {
    Bytes bytes = packed_bytes(line);
    const auto flip = [&](std::size_t bit) {
      bytes[bit / 8] = static_cast<std::uint8_t>(bytes[bit / 8] ^ 1U << bit % 8);
    };
    for (std::size_t a = 0; a < 8 * bytes.size(); ++a) {
      flip(a);
      for (std::size_t b = a; b < 8 * bytes.size(); ++b) {
        if (b != a) flip(b);
        const Fate fate = fate_of(bytes, line);
        EXPECT_NE(fate, Fate::other) << line << " bits " << a << ' ' << b;
        same += fate == Fate::same ? 1 : 0;
        ++tried;
        if (b != a) flip(b);
      }
      flip(a);
    }
  }
  fmt::print("{} errors of one and two bits: {} harmless, none accepted\n", tried, same);
}

RC_GTEST_PROP(PackedForm, NoDamageMakesAnotherDatagram, ()) {
  const std::string line = *any_datagram();
  Bytes bytes = packed_bytes(line);
  RC_PRE(!bytes.empty());
  for (int round = 0; round < 20; ++round) {
    Bytes damaged = bytes;
    const int errors = *rc::gen::inRange(1, 5);
    for (int i = 0; i < errors; ++i) {
      damaged[*rc::gen::inRange<std::size_t>(0, damaged.size())] =
          *rc::gen::arbitrary<std::uint8_t>();
    }
    if (*rc::gen::inRange(0, 4) == 0)
      damaged.resize(*rc::gen::inRange<std::size_t>(0, bytes.size()));
    RC_ASSERT(fate_of(damaged, line) != Fate::other);
  }
}

// Lost frames on a bus can join the beginning of one datagram and the end of another.
TEST(PackedForm, DetectsTwoDatagramsSplicedAtAFrame) {
  std::vector<std::string> lines;
  for (const test::CapturedLine& line : paper_capture()) {
    if (line.from_board) lines.push_back(line.bytes);
  }
  for (const std::string& first : lines) {
    for (const std::string& second : lines) {
      const Bytes a = packed_bytes(first);
      const Bytes b = packed_bytes(second);
      for (std::size_t cut = 6; cut < std::min(a.size(), b.size()); cut += 7) {
        Bytes spliced(a.begin(), a.begin() + static_cast<std::ptrdiff_t>(cut));
        spliced.insert(spliced.end(), b.begin() + static_cast<std::ptrdiff_t>(cut), b.end());
        EXPECT_TRUE(fate_of(spliced, first) != Fate::other || unpacked(spliced) == second);
      }
    }
  }
}

}  // namespace
}  // namespace r4
