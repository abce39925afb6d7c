// SPDX-License-Identifier: GPL-3.0-or-later
// Reads, interprets and writes again every datagram that the paper prints (section 4.4).
#include <gtest/gtest.h>

#include <string>

#include "protocol/messages/command_field.hpp"
#include "protocol/messages/message.hpp"
#include "protocol/messages/state_fields.hpp"
#include "r4link/command.hpp"
#include "r4link/datagram.hpp"
#include "r4link/messages/datagram_writer.hpp"
#include "r4link/state.hpp"
#include "tests/support/datagrams.hpp"

namespace r4 {
namespace {

using test::CapturedLine;
using test::paper_capture;
using test::str;

std::string state_again(const Datagram& datagram) {
  State state;
  EXPECT_TRUE(read_state(datagram, state));
  EXPECT_EQ(state.present, FieldSet::paper_default());
  char buffer[max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  for (const StateField field : state.present) write_field(writer, field, state);
  return str(writer.finish(state.pnum, state.t_ms));
}

std::string command_again(const Datagram& datagram) {
  Command command;
  EXPECT_EQ(parse_command(datagram.command(), command), Refusal::none);
  EXPECT_EQ(datagram.command_count(), 1);
  char buffer[max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  write_command(writer, command);
  if (datagram.has_pnum()) return str(writer.finish(datagram.pnum(), datagram.time_ms()));
  writer.field("T").value(datagram.time_ms());
  return str(writer.finish());
}

std::string written_again(const CapturedLine& line, const Datagram& datagram) {
  switch (kind_of(datagram)) {
    case MessageKind::board_heartbeat: {
      EXPECT_TRUE(line.from_board);
      char buffer[max_datagram];
      return str(write_board_heartbeat(buffer, sizeof buffer, datagram.pnum(),
                                       static_cast<std::uint32_t>(datagram.time_ms()),
                                       heartbeat_reason(datagram)));
    }
    case MessageKind::state:
      EXPECT_TRUE(line.from_board);
      return state_again(datagram);
    case MessageKind::host_heartbeat:
    case MessageKind::command:
      EXPECT_FALSE(line.from_board);
      return command_again(datagram);
    case MessageKind::nack:
    case MessageKind::identity:
      break;
  }
  return "a kind that the capture does not have";
}

struct Damaged {
  std::uint32_t pnum;
  std::uint32_t expected;
  std::uint32_t found;
};
constexpr Damaged damaged_in_print[] = {{7460, 0xC9640169, 0x306EB6AC},
                                        {7491, 0x9C593820, 0xF80CA3AD}};

TEST(PaperCapture, EveryDatagramIsReadAndWrittenAgainByteForByte) {
  int good = 0;
  for (const CapturedLine& line : paper_capture()) {
    Datagram datagram;
    if (!read_datagram(line.bytes, datagram)) continue;
    ++good;
    EXPECT_EQ(written_again(line, datagram), line.bytes);
  }
  EXPECT_EQ(paper_capture().size(), 71U);
  EXPECT_EQ(good, 69);
}

TEST(PaperCapture, TheTwoMisprintedDatagramsFailTheirChecksum) {
  std::size_t next = 0;
  for (const CapturedLine& line : paper_capture()) {
    Datagram datagram;
    const ReadResult result = read_datagram(line.bytes, datagram);
    if (result) continue;
    ASSERT_LT(next, std::size(damaged_in_print));
    const Damaged& damaged = damaged_in_print[next++];
    EXPECT_NE(line.bytes.find("PNum:" + std::to_string(damaged.pnum) + ";"), std::string::npos);
    EXPECT_EQ(result.error, ReadError::crc);
    EXPECT_EQ(result.crc_expected, damaged.expected);
    EXPECT_EQ(result.crc_found, damaged.found);
    EXPECT_EQ(result.position, line.bytes.find("^0x") + 3);
  }
  EXPECT_EQ(next, std::size(damaged_in_print));
}

TEST(PaperCapture, TheFirstStateHasThePrintedValues) {
  const std::string bytes = test::captured_state();
  Datagram datagram;
  ASSERT_TRUE(read_datagram(bytes, datagram));
  State state;
  ASSERT_TRUE(read_state(datagram, state));
  EXPECT_EQ(state.pnum, 7434U);
  EXPECT_EQ(state.t_ms, 79090U);
  EXPECT_EQ(state.raw.analog_cv[static_cast<int>(Analog::ain24)], 2428);
  EXPECT_EQ(state.raw.analog_cv[static_cast<int>(Analog::ain12)], 1212);
  EXPECT_EQ(state.raw.analog_cv[static_cast<int>(Analog::ain5)], 512);
  EXPECT_EQ(state.raw.analog_cv[static_cast<int>(Analog::aindmh)], 1211);
  EXPECT_EQ(state.raw.analog_cv[static_cast<int>(Analog::ainsteer)], 103);
  EXPECT_TRUE(state.handle_held());
  EXPECT_EQ(state.raw.dhb12[0], (Drive{4095, Direction::forward}));
  EXPECT_EQ(state.raw.osmc[0], (Drive{400, Direction::forward}));
  EXPECT_EQ(state.raw.stepper_steps[0], -100);
  EXPECT_EQ(state.raw.servo_us[0], 2000);
}

}  // namespace
}  // namespace r4
