// SPDX-License-Identifier: GPL-3.0-or-later
#include "protocol/messages/message.hpp"

#include <gtest/gtest.h>

#include <string>

#include "protocol/messages/site_settings.hpp"
#include "tests/support/datagrams.hpp"

namespace r4 {
namespace {

using test::captured_state;
using test::str;
using test::with_crc;

// A datagram and the bytes that it views.
struct Read {
  explicit Read(std::string_view fields) : bytes(with_crc(fields)) {
    EXPECT_TRUE(read_datagram(bytes, datagram)) << fields;
  }
  Read(const Read&) = delete;
  Read& operator=(const Read&) = delete;
  std::string bytes;
  Datagram datagram;
};

TEST(Message, RecognizesTheKindByItsField) {
  struct Case {
    const char* fields;
    MessageKind kind;
    const char* word;
  };
  for (const Case& c :
       {Case{"H:R4-ROS2;PNum:7446;T:79201;", MessageKind::board_heartbeat, "heartbeat"},
        Case{"H:R4-ROS2;PNum:1;T:2;SAFE:1;", MessageKind::board_heartbeat, "heartbeat"},
        Case{"H:ROS2-R4;T:79201;", MessageKind::host_heartbeat, "heartbeat"},
        Case{"PNum:1;T:2;H:ROS2-R4;", MessageKind::host_heartbeat, "heartbeat"},
        Case{"H:other;", MessageKind::command, "command"},
        Case{"O:1,0,1;PNum:67;T:1;", MessageKind::command, "command"},
        Case{"X:1;PNum:67;T:1;", MessageKind::command, "command"},
        Case{"O:1,0,1;H:ROS2-R4;PNum:1;", MessageKind::command, "command"},
        Case{"H:ROS2-R4;O:1,0,1;PNum:1;", MessageKind::command, "command"},
        Case{"N:66,RANGE;PNum:1;T:2;", MessageKind::nack, "nack"},
        Case{"I:R4,0.1.0,x,udp;PNum:1;T:2;", MessageKind::identity, "identity"},
        Case{"AIN24:24.28;PNum:1;T:2;", MessageKind::state, "state"},
        Case{"A:1;T:2;", MessageKind::state, "state"}}) {
    const Read message(c.fields);
    EXPECT_EQ(kind_of(message.datagram), c.kind) << c.fields;
    EXPECT_STREQ(to_text(kind_of(message.datagram)), c.word) << c.fields;
  }
}

TEST(Message, ABoardHeartbeatMatchesThePaper) {
  char buffer[max_datagram];
  EXPECT_EQ(str(write_board_heartbeat(buffer, sizeof buffer, 0, 0, SafeReason::none)),
            "H:R4-ROS2;PNum:0;T:0;^0xb10b3a06^");
  EXPECT_EQ(str(write_board_heartbeat(buffer, sizeof buffer, 7446, 79201, SafeReason::none)),
            "H:R4-ROS2;PNum:7446;T:79201;^0x369e8e0a^");
  EXPECT_TRUE(write_board_heartbeat(buffer, 10, 0, 0, SafeReason::none).empty());
}

TEST(Message, ABoardHeartbeatHasTheReasonAfterTheTime) {
  for (int reason = 1; reason < safe_reason_count; ++reason) {
    char buffer[max_datagram];
    const Text bytes =
        write_board_heartbeat(buffer, sizeof buffer, 5, 6, static_cast<SafeReason>(reason));
    EXPECT_EQ(str(bytes), with_crc("H:R4-ROS2;PNum:5;T:6;SAFE:" + std::to_string(reason) + ";"));
    Datagram datagram;
    ASSERT_TRUE(read_datagram(bytes, datagram));
    EXPECT_EQ(heartbeat_reason(datagram), static_cast<SafeReason>(reason));
  }
}

TEST(Message, ABoardHeartbeatNamesTheCauseAndTheStop) {
  SafeReport report(SafeReason::stop);
  report.cause = 734003;
  report.has_stop = true;
  report.stop = 4294967295U;
  char buffer[max_datagram];
  const Text bytes = write_board_heartbeat(buffer, sizeof buffer, 12, 790, report);
  EXPECT_EQ(str(bytes), with_crc("H:R4-ROS2;PNum:12;T:790;SAFE:2;CAUSE:734003;STOP:4294967295;"));
  Datagram datagram;
  ASSERT_TRUE(read_datagram(bytes, datagram));
  const SafeReport again = heartbeat_report(datagram);
  EXPECT_EQ(again.reason, SafeReason::stop);
  EXPECT_EQ(again.cause, 734003);
  EXPECT_TRUE(again.has_stop);
  EXPECT_EQ(again.stop, 4294967295U);
}

TEST(Message, IgnoresAnInvalidCauseOrStop) {
  for (const char* value : {"", "-1", "x", "1,2", "4294967296"}) {
    const SafeReport report = heartbeat_report(
        Read("H:R4-ROS2;SAFE:2;CAUSE:" + std::string(value) + ";STOP:" + value + ";").datagram);
    EXPECT_EQ(report.cause, 0) << value;
    EXPECT_FALSE(report.has_stop) << value;
  }
}

TEST(Message, ARefusalNamesTheSession) {
  Nack nack;
  nack.pnum = 7;
  nack.code = Refusal::stale;
  nack.has_session = true;
  nack.session = 2147484600U;
  char buffer[max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  write_nack(writer, nack);
  Datagram datagram;
  const Text bytes = writer.finish(1, 2);
  EXPECT_EQ(str(bytes), with_crc("N:7,STALE;SESSION:2147484600;PNum:1;T:2;"));
  ASSERT_TRUE(read_datagram(bytes, datagram));
  Nack again;
  ASSERT_TRUE(read_nack(datagram, again));
  EXPECT_TRUE(again.has_session);
  EXPECT_EQ(again.session, nack.session);
  ASSERT_TRUE(read_nack(Read("N:7,STALE;").datagram, again));
  EXPECT_FALSE(again.has_session);
}

TEST(Message, ARefusalOfAGroupNamesTheCommand) {
  Nack nack;
  nack.pnum = 7;
  nack.code = Refusal::range;
  nack.at = 3;
  nack.has_session = true;
  nack.session = 9;
  char buffer[max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  write_nack(writer, nack);
  const Text bytes = writer.finish(1, 2);
  EXPECT_EQ(str(bytes), with_crc("N:7,RANGE;AT:3;SESSION:9;PNum:1;T:2;"));
  Nack again;
  ASSERT_TRUE(read_nack(Read("N:7,RANGE;SESSION:9;AT:3;").datagram, again))
      << "the fields may come in any order";
  EXPECT_EQ(again.at, 3);
  for (const char* fields :
       {"N:7,RANGE;", "N:7,RANGE;AT:256;", "N:7,RANGE;AT:x;", "N:7,RANGE;AT:;"}) {
    ASSERT_TRUE(read_nack(Read(fields).datagram, again)) << fields;
    EXPECT_EQ(again.at, 0) << fields;
  }
}

TEST(Message, ABoardHeartbeatHasTheNonceAfterTheReason) {
  char buffer[max_datagram];
  const Text bytes =
      write_board_heartbeat(buffer, sizeof buffer, 12, 790, SafeReason::stop, "0123456789abcdef");
  Datagram datagram;
  ASSERT_TRUE(read_datagram(bytes, datagram));
  EXPECT_EQ(test::str(bytes).find("H:R4-ROS2;PNum:12;T:790;SAFE:2;AN:0123456789abcdef;^"), 0U);
  EXPECT_EQ(test::str(heartbeat_nonce(datagram)), "0123456789abcdef");
  EXPECT_FALSE(is_connecting_heartbeat(datagram));
}

TEST(Message, AConnectingHeartbeatHasNumberZeroAndNoTimeOrANonce) {
  const auto connecting = [](const std::string& fields) {
    const std::string bytes = test::with_crc(fields);
    Datagram datagram;
    EXPECT_TRUE(read_datagram(Text(bytes), datagram));
    return is_connecting_heartbeat(datagram);
  };
  EXPECT_TRUE(connecting("H:R4-ROS2;PNum:0;T:0;"));
  EXPECT_TRUE(connecting("H:R4-ROS2;PNum:0;T:79146;AN:0123456789abcdef;"));
  EXPECT_FALSE(connecting("H:R4-ROS2;PNum:0;T:79146;"));
  EXPECT_FALSE(connecting("H:R4-ROS2;PNum:0;T:79146;AN:0123;"));
  EXPECT_FALSE(connecting("H:R4-ROS2;PNum:1;T:79146;AN:0123456789abcdef;"));
}

TEST(Message, AMissingOrZeroReasonIsNone) {
  for (const char* fields : {"H:R4-ROS2;", "H:R4-ROS2;SAFE:0;"}) {
    EXPECT_EQ(heartbeat_reason(Read(fields).datagram), SafeReason::none) << fields;
  }
}

TEST(Message, AnUnknownReasonIsReadAsAFault) {
  for (const char* fields : {"H:R4-ROS2;SAFE:7;", "H:R4-ROS2;SAFE:4294967295;", "H:R4-ROS2;SAFE:;",
                             "H:R4-ROS2;SAFE:1,2;", "H:R4-ROS2;SAFE:link;"}) {
    EXPECT_EQ(heartbeat_reason(Read(fields).datagram), SafeReason::fault) << fields;
  }
}

TEST(Message, RefusalsRoundTripWithEveryCode) {
  for (int code = 1; code <= static_cast<int>(Refusal::full); ++code) {
    char buffer[max_datagram];
    DatagramWriter writer(buffer, sizeof buffer);
    write_nack(writer, Nack{4294967295U, static_cast<Refusal>(code)});
    Datagram datagram;
    ASSERT_TRUE(read_datagram(writer.finish(1, 2), datagram));
    Nack nack;
    ASSERT_TRUE(read_nack(datagram, nack));
    EXPECT_EQ(nack.pnum, 4294967295U);
    EXPECT_EQ(nack.code, static_cast<Refusal>(code));
  }
}

TEST(Message, RejectsInvalidRefusals) {
  for (const char* fields :
       {"A:1;", "N:;", "N:66;", "N:66,;", "N:66,NONE;", "N:66,range;", "N:66,OTHER;",
        "N:66,RANGE,1;", "N:-1,RANGE;", "N:4294967296,RANGE;", "N:,RANGE;", "N:x,RANGE;"}) {
    Nack nack{77, Refusal::busy};
    EXPECT_FALSE(read_nack(Read(fields).datagram, nack)) << fields;
    EXPECT_EQ(nack.pnum, 77U) << fields;
    EXPECT_EQ(nack.code, Refusal::busy) << fields;
  }
}

TEST(Message, IdentityRoundTrips) {
  char buffer[max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  write_identity(writer, Identity{"0.1.0", "0042AF", "udp+serial"});
  const Text bytes = writer.finish(1, 2);
  EXPECT_EQ(str(bytes), with_crc("I:R4,0.1.0,0042AF,udp+serial;PNum:1;T:2;"));
  Datagram datagram;
  ASSERT_TRUE(read_datagram(bytes, datagram));
  Identity identity;
  ASSERT_TRUE(read_identity(datagram, identity));
  EXPECT_EQ(str(identity.firmware), "0.1.0");
  EXPECT_EQ(str(identity.board_id), "0042AF");
  EXPECT_EQ(str(identity.capabilities), "udp+serial");
  EXPECT_TRUE(has_capability(identity.capabilities, "udp"));
  EXPECT_TRUE(has_capability(identity.capabilities, "serial"));
  for (const char* each : {"ser", "udp+serial", "leave", "erial"}) {
    const Text word(each, std::char_traits<char>::length(each));
    EXPECT_FALSE(has_capability(identity.capabilities, word)) << each;
  }
}

TEST(Message, AnIdentityHasTheNameTheBusyFlagAndTheQuestion) {
  char buffer[max_datagram];
  for (const bool busy : {false, true}) {
    DatagramWriter writer(buffer, sizeof buffer);
    Identity told{"0.1.0", "0042AF", "udp"};
    told.name = "left";
    told.has_busy = true;
    told.busy = busy;
    told.has_asked = true;
    told.asked = 4294967295;
    write_identity(writer, told);
    write_identity_fields(writer, told);
    const Text bytes = writer.finish(1, 2);
    EXPECT_EQ(str(bytes), with_crc("I:R4,0.1.0,0042AF,udp;NAME:left;BUSY:" +
                                   std::to_string(busy ? 1 : 0) + ";ASKED:4294967295;PNum:1;T:2;"));
    Datagram datagram;
    ASSERT_TRUE(read_datagram(bytes, datagram));
    EXPECT_EQ(kind_of(datagram), MessageKind::identity);
    Identity identity;
    ASSERT_TRUE(read_identity(datagram, identity));
    EXPECT_EQ(str(identity.name), "left");
    EXPECT_TRUE(identity.has_busy);
    EXPECT_EQ(identity.busy, busy);
    EXPECT_TRUE(identity.has_asked);
    EXPECT_EQ(identity.asked, 4294967295U);
  }
}

TEST(Message, AnIdentityIsReadWithoutItsInvalidFields) {
  for (const std::string& fields :
       {std::string(), std::string("NAME:;BUSY:;"), std::string("NAME:a b;BUSY:2;"),
        std::string("NAME:a,b;BUSY:1,0;ASKED:1,2;"), std::string("NAME:off;BUSY:-1;ASKED:-1;"),
        "NAME:" + std::string(32, 'n') + ";BUSY:01;ASKED:4294967296;"}) {
    Identity identity;
    identity.name = "before";
    identity.has_busy = identity.busy = identity.has_asked = true;
    ASSERT_TRUE(read_identity(Read("I:R4,a,b,c;" + fields).datagram, identity)) << fields;
    EXPECT_EQ(str(identity.name), "") << fields;
    EXPECT_FALSE(identity.has_busy || identity.busy || identity.has_asked) << fields;
  }
}

TEST(Message, RejectsInvalidIdentities) {
  const std::string longest(board_id_max, 'n');
  for (const std::string& fields :
       {std::string("A:1;"), std::string("I:;"), std::string("I:R4;"), std::string("I:R4,a,b;"),
        std::string("I:R5,a,b,c;"), std::string("I:R4,a,b,c,d;"), std::string("I:R4,a,,c;"),
        std::string("I:R4,a,=1+cmd|calc!A0,c;"), std::string("I:R4,a,<b>,c;"),
        std::string("I:R4,a,b b,c;"), "I:R4,a," + longest + "n,c;"}) {
    Identity identity;
    identity.firmware = "kept";
    EXPECT_FALSE(read_identity(Read(fields).datagram, identity)) << fields;
    EXPECT_EQ(str(identity.firmware), "kept") << fields;
  }
  const Read read("I:R4,a," + longest + ",c;");
  Identity identity;
  EXPECT_TRUE(read_identity(read.datagram, identity));
  EXPECT_EQ(str(identity.board_id), longest);
}

}  // namespace
}  // namespace r4
