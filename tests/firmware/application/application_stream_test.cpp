// SPDX-License-Identifier: GPL-3.0-or-later
// The stream of states: when they are sent, their fields, and the number of datagrams.
#include <gtest/gtest.h>

#include <set>

#include "tests/firmware/board_fixture.hpp"

namespace r4 {
namespace {

using test::another_session;
using test::Heard;
using test::our_session;
using test::TestBoard;
using test::TestHost;

TEST(ApplicationStream, SendsTheDatagramOfTheCapture) {
  TestBoard board(Settings(), 1, 79090);
  const std::int32_t volts[] = {2428, 1212, 512, 1211, 103, 0};
  std::copy(std::begin(volts), std::end(volts), board.hal.inputs.analog_cv);
  board.hal.inputs.stepper_steps[0] = -100;
  TestHost host(board, no_session);
  host.heartbeat(1699276044000);
  host.command("D:4095,1,1");
  host.command("O:400,1,1");
  host.command("S:2000,1");
  board.take();
  board.run(10);
  const std::vector<Heard> heard = board.take(MessageKind::state);
  ASSERT_EQ(heard.size(), 1U);
  EXPECT_EQ(heard[0].bytes,
            test::with_crc("AIN24:24.28;AIN12:12.12;AIN5:5.12;AINDMH:12.11;DMHSTA:1;AINSTEER:1.03;"
                           "DHB1A:4095,1;OSMC1:400,1;STEP1POS:-100;SERVO1POS:2000;PNum:" +
                           std::to_string(heard[0].pnum) + ";T:79100;"));
}

TEST(ApplicationStream, SkipsAndCountsLateStates) {
  TestBoard board;
  TestHost host(board, no_session);
  host.heartbeat(5);
  host.command("F:LATE");
  const std::uint32_t start = board.now_ms;
  board.take();
  board.now_ms = start + 57;  // 10, 20, 30 and 40 are past, 50 is due
  board.application->poll(board.now_ms);
  const std::vector<Heard> heard = board.take(MessageKind::state);
  ASSERT_EQ(heard.size(), 1U);
  EXPECT_EQ(heard[0].t_ms, start + 50);
  EXPECT_EQ(state_of(heard[0]).late, 4U);
}

TEST(ApplicationStream, SendsTheNewestInputs) {
  TestBoard board;
  TestHost host(board, no_session);
  host.heartbeat(5);
  host.command("F:ALL");
  board.hal.inputs.analog_cv[5] = 33;
  board.hal.inputs.encoder_counts[3] = -7;
  board.hal.inputs.encoder_hz[2] = -4000;
  board.hal.inputs.encoder_index_counts[1] = 1000;
  board.hal.inputs.ultrasonic_cm[2] = 123;
  board.hal.inputs.stepper_steps[1] = 2'000'000'000;
  board.take();
  board.run(10);
  const State state = state_of(board.take(MessageKind::state).back());
  EXPECT_EQ(state.raw.analog_cv[5], 33);
  EXPECT_EQ(state.raw.encoder_counts[3], -7);
  EXPECT_EQ(state.raw.encoder_hz[2], -4000);
  EXPECT_EQ(state.raw.encoder_index_counts[1], 1000);
  EXPECT_EQ(state.raw.ultrasonic_cm[2], 123);
  EXPECT_EQ(state.raw.stepper_steps[1], 2'000'000'000);
}

// Makes every field as long as possible.
void fill(TestBoard& board, TestHost& host) {
  for (auto& cv : board.hal.inputs.analog_cv) cv = -327'680;
  for (auto& steps : board.hal.inputs.stepper_steps) steps = -2'000'000'000;
  for (int i = 0; i < encoder_channels; ++i) {
    board.hal.inputs.encoder_counts[i] = -2'000'000'000;
    board.hal.inputs.encoder_hz[i] = -2'000'000'000;
    board.hal.inputs.encoder_index_counts[i] = -2'000'000'000;
  }
  for (auto& cm : board.hal.inputs.ultrasonic_cm) cm = 400;
  for (int ch = 1; ch <= 4; ++ch) {
    const std::string n = std::to_string(ch);
    host.command("O:4095,1," + n);
    host.command("D:4095,1," + n);
    host.command("B:4095,1,1," + n);
  }
  for (int ch = 1; ch <= 16; ++ch) host.command("S:2500," + std::to_string(ch));
  for (int ch = 1; ch <= 8; ++ch) host.command("R:" + std::to_string(ch) + ",On");
}

TEST(ApplicationStream, SplitsAStateThatIsTooLongForThePort) {
  for (const std::size_t limit : {std::size_t{508}, max_datagram}) {
    TestBoard board;
    board.ports[0].limit = limit;
    TestHost host(board, our_session);
    host.connect();
    fill(board, host);
    host.command("F:ALL");
    board.take();
    board.run(10);
    const std::vector<Heard> parts = board.take(MessageKind::state);
    EXPECT_EQ(parts.size(), limit == 508 ? 3U : 1U);
    FieldSet seen;
    for (std::size_t i = 0; i < parts.size(); ++i) {
      EXPECT_LE(parts[i].bytes.size(), limit);
      EXPECT_EQ(parts[i].t_ms, parts[0].t_ms);
      EXPECT_EQ(parts[i].pnum, parts[0].pnum + i);
      const State state = state_of(parts[i]);
      for (int f = 0; f < state_field_count; ++f) {
        const StateField field = static_cast<StateField>(f);
        if (!state.present.has(field)) continue;
        EXPECT_FALSE(seen.has(field)) << test::str(name_of(field));
        seen.add(field);
      }
    }
    EXPECT_TRUE(seen == FieldSet::all());
  }
}

TEST(ApplicationStream, EveryPartOfAStateReportsTheReason) {
  TestBoard board;
  board.ports[0].limit = 508;
  TestHost host(board, our_session);
  host.connect();
  fill(board, host);
  host.command("F:ALL");
  host.command("E:STOP");
  board.take();
  board.run(10);
  const std::vector<Heard> parts = board.take(MessageKind::state);
  EXPECT_GE(parts.size(), 2U);
  for (const Heard& part : parts) {
    EXPECT_LE(part.bytes.size(), 508U);
    EXPECT_EQ(state_of(part).safe, SafeReason::stop);
    EXPECT_NE(part.bytes.find(";SAFE:2;PNum:"), std::string::npos) << part.bytes;
  }
}

TEST(ApplicationStream, EachPortGetsPartsOfItsOwnSize) {
  TestBoard board(Settings(), 2);
  board.ports[1].limit = 508;
  TestHost host(board, our_session);
  host.connect();
  fill(board, host);
  host.command("F:ALL");
  board.take(0);
  board.take(1);
  board.run(20);
  EXPECT_EQ(board.take(MessageKind::state, 0).size(), 2U);
  EXPECT_EQ(board.take(MessageKind::state, 1).size(), 6U);
}

TEST(ApplicationStream, SendsTheSelectedFields) {
  TestBoard board;
  TestHost host(board, our_session);
  host.connect();
  host.command("F:RELAYS,AIN24,SAFE");
  host.command("R:3,On");
  board.take();
  board.run(10);
  const std::vector<Heard> heard = board.take(MessageKind::state);
  ASSERT_EQ(heard.size(), 1U);
  EXPECT_EQ(heard[0].bytes.rfind("AIN24:0.00;RELAYS:4;SAFE:0;PNum:", 0), 0U);
  host.command("F:DEFAULT");
  board.run(10);
  EXPECT_TRUE(state_of(board.take(MessageKind::state).back()).present == FieldSet::paper_default());
}

TEST(ApplicationStream, MarksOnlyStatesAsReplaceable) {
  TestBoard board;
  TestHost host(board, our_session);
  host.connect();
  host.command("X:1");
  host.command("Q:ID");
  board.run(500);
  for (const test::MemoryPort::Sent& sent : board.ports[0].sent) {
    Datagram datagram;
    ASSERT_TRUE(read_datagram(sent.bytes, datagram));
    EXPECT_EQ(sent.priority == Priority::state, kind_of(datagram) == MessageKind::state);
  }
}

TEST(ApplicationStream, AsksForTheNextPollBeforeItsNextDeadline) {
  TestBoard board;
  EXPECT_LE(board.application->poll(board.now_ms), 10U);
  TestHost host(board, no_session);
  host.heartbeat(5);
  host.command("C:rate,1000");
  board.run(10);
  EXPECT_EQ(board.application->poll(board.now_ms), 1U);
  host.command("C:rate,1");
  board.run(5);
  EXPECT_LE(board.application->poll(board.now_ms), firmware::Application::interlock_period_ms);
}

}  // namespace
}  // namespace r4
