// SPDX-License-Identifier: GPL-3.0-or-later
// Checksums, signatures, numbers, lines and the packed form on the board. The compiler, the C
// library or the byte order could make the results differ from the results on the build machine.
#include "on_target.hpp"
#include "protocol/datagram/crc32.hpp"
#include "protocol/datagram/numbers.hpp"
#include "protocol/keys/authentication.hpp"
#include "protocol/messages/state_fields.hpp"
#include "r4link/datagram.hpp"
#include "r4link/messages/datagram_writer.hpp"
#include "r4link/messages/packed_form.hpp"
#include "r4link/state.hpp"
#include "transports/framing/line_framing.hpp"

namespace {

using namespace r4;

// The first state of the paper's capture.
constexpr char captured[] =
    "AIN24:24.28;AIN12:12.15;AIN5:5.11;AINDMH:12.19;DMHSTA:1;AINSTEER:1.03;DHB1A:0,0;OSMC1:0,0;"
    "STEP1POS:0;SERVO1POS:0;PNum:22;T:79146;";

Text whole(char* buffer, std::size_t capacity) {
  DatagramWriter writer(buffer, capacity);
  State state;
  state.raw.analog_cv[0] = 2428;
  state.raw.analog_cv[1] = 1215;
  state.raw.analog_cv[2] = 511;
  state.raw.analog_cv[3] = 1219;
  state.raw.analog_cv[4] = 103;
  state.handle = Handle::held;
  for (const StateField field : FieldSet::paper_default()) write_field(writer, field, state);
  return writer.finish(22, 79146);
}

template <class Number>
bool round_trip(Number value, Text text) {
  char out[max_number_text];
  const Text written(out, static_cast<std::size_t>(write_number(out, value) - out));
  Number read_back = 0;
  return written == text && parse_number(written, read_back) && read_back == value;
}

}  // namespace

TEST(Crc32, MatchesZlib) {
  EXPECT(crc32("123456789") == 0xCBF43926U);
  EXPECT(crc32("") == 0);
  EXPECT(crc32("6789", crc32("12345")) == 0xCBF43926U);
  EXPECT(crc32("O:358,1,1;PNum:66;T:1699276044383;^") == 0x7FEFAE81U);  // from the paper
}

TEST(AuthenticationTag, MatchesPythonsHashlib) {
  Key key;
  key.id = 3;
  for (std::uint8_t i = 0; i < key_size; ++i) key.bytes[i] = i;
  char tag[tag_size];
  write_tag(signing_key(key), "0123456789abcdef",
            "O:358,1,1;PNum:2147484648;T:1699276044383;A:3,1700000000000000,79146", tag);
  EXPECT(Text(tag, tag_size) == "YDgO3-AnQVQ");
}

TEST(Numbers, RoundTripThroughText) {
  EXPECT(round_trip<std::uint32_t>(0, "0"));
  EXPECT(round_trip<std::uint32_t>(4294967295U, "4294967295"));
  EXPECT(round_trip<std::int32_t>(-2147483647 - 1, "-2147483648"));
  EXPECT(round_trip<std::uint64_t>(18446744073709551615U, "18446744073709551615"));
  std::uint32_t number = 7;
  EXPECT(!parse_number(Text("4294967296"), number) && number == 7);
  std::int32_t hundredths = 0;
  EXPECT(parse_hundredths("-0.5", hundredths) && hundredths == -50);
}

TEST(StateDatagram, MatchesTheCapture) {
  char buffer[max_datagram];
  const Text datagram = whole(buffer, sizeof buffer);
  EXPECT(datagram.substr(0, sizeof captured - 1) == Text(captured));
  Datagram seen;
  State state;
  EXPECT(read_datagram(datagram, seen));
  EXPECT(read_state(seen, state) && state.raw.analog_cv[0] == 2428 && state.handle_held());
  EXPECT(state.pnum == 22 && state.t_ms == 79146);
}

TEST(StateDatagram, IsRefusedWithOneBitWrong) {
  char buffer[max_datagram];
  const Text datagram = whole(buffer, sizeof buffer);
  Datagram seen;
  std::uint32_t accepted = 0;
  for (std::size_t i = 0; i < datagram.size(); ++i) {
    buffer[i] = static_cast<char>(buffer[i] ^ 1);
    if (read_datagram(datagram, seen)) ++accepted;
    buffer[i] = static_cast<char>(buffer[i] ^ 1);
  }
  EXPECT(accepted == 0);
  EXPECT(read_datagram(datagram, seen));
}

TEST(LineFraming, FindsALineSplitAtAnyByte) {
  char buffer[max_datagram + 2];
  const Text datagram = whole(buffer, max_datagram);
  const std::size_t size = datagram.size() + line_end.size();
  std::memcpy(buffer + datagram.size(), line_end.data(), line_end.size());
  for (std::size_t cut = 0; cut <= size; ++cut) {
    static LineFraming framing;
    std::uint32_t lines = 0;
    const auto on_line = [&](Text line) { lines += line == datagram ? 1 : 100; };
    framing.push(buffer, cut, on_line);
    framing.push(buffer + cut, size - cut, on_line);
    EXPECT(lines == 1 && framing.pending() == 0);
  }
}

TEST(PackedForm, RestoresTheSameBytes) {
  char buffer[max_datagram];
  char back[max_datagram];
  std::uint8_t packed[max_datagram];
  const Text datagram = whole(buffer, sizeof buffer);
  const std::size_t size = pack(datagram, packed, sizeof packed);
  EXPECT(size != 0 && size < 64);
  const UnpackResult result = unpack(packed, size, back, sizeof back);
  EXPECT(result && Text(back, result.size) == datagram);
}
