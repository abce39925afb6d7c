// SPDX-License-Identifier: GPL-3.0-or-later
// The board's side of its transports, without their chips.
#include <cstring>

#include "firmware/ports/m7/links/udp_frames.hpp"
#include "firmware/ports/transmit_lines.hpp"
#include "on_target.hpp"

namespace {

using namespace r4;
using namespace r4::firmware;
using namespace r4::m7;

// Takes all bytes that the UART would send now.
Text drain(TransmitLines& lines, char* out, std::size_t size) {
  std::size_t used = 0;
  while (used < size && lines.take(out[used])) ++used;
  return Text(out, used);
}

constexpr std::uint32_t board_address = 0x0A00020F;
constexpr std::uint16_t board_port = 2018;

Mac mac(std::uint8_t last) {
  Mac mac;
  mac.bytes[0] = 0x52;
  mac.bytes[5] = last;
  return mac;
}

// The board's side, a received frame, and a buffer for an answer.
struct End {
  UdpFrames board{board_address, board_port};
  alignas(4) std::uint8_t frame[1536];
  std::uint8_t reply[UdpFrames::min_frame];

  End() { board.set_mac(mac(1)); }
  UdpFrames::Arrival arp_of_host() {
    static const std::uint8_t request[] = {
        0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x52, 0,    0, 0, 0, 2, 8, 6, 0, 1, 8,    0, 6, 4, 0, 1,
        0x52, 0,    0,    0,    0,    2,    0x0A, 0x00, 2, 2, 0, 0, 0, 0, 0, 0, 0x0A, 0, 2, 15};
    std::memcpy(frame, request, sizeof request);
    return board.take(frame, sizeof request, reply);
  }
};

// A datagram "H:R4" from 10.0.2.2:5000 to the board's port, as QEMU's network sends it. The UDP
// checksum is 0 (none).
std::size_t question(std::uint8_t* frame) {
  static const std::uint8_t bytes[] = {
      0x52, 0,    0,    0,    0, 1,  0x52, 0, 0,  0,  0,    2,    8,  0,        // Ethernet
      0x45, 0,    0,    32,   0, 0,  0,    0, 64, 17, 0x62, 0xBD, 10, 0, 2, 2,  // IP
      10,   0,    2,    15,                                                     //
      0x13, 0x88, 0x07, 0xE2, 0, 12, 0,    0,                                   // UDP
      'H',  ':',  'R',  '4'};
  std::memcpy(frame, bytes, sizeof bytes);
  return sizeof bytes;
}
UdpAddress asker() {
  UdpAddress address;
  address.mac = mac(2);
  address.host = 0x0202;
  address.port = 5000;
  return address;
}

}  // namespace

TEST(TransmitLines, KeepTheNewestStateForAHostThatDoesNotRead) {
  static TransmitLines lines;
  static char out[8192];
  char state[] = "state 0000";
  for (int i = 0; i < 1000; ++i) {
    state[9] = static_cast<char>('0' + i % 10);
    lines.put_state(Text(state, 10));
    lines.put("H");
    lines.poll(static_cast<std::uint32_t>(i));
  }
  const Text first = drain(lines, out, sizeof out);
  EXPECT(first.size() < TransmitLines::capacity);
  lines.poll(1001);
  const Text rest = drain(lines, out, sizeof out);
  const Text newest("state 0009\r\n");
  const Text all = rest.empty() ? first : rest;
  EXPECT(lines.dropped() > 800 && all.size() >= newest.size());
  EXPECT(all.substr(all.size() - newest.size()) == newest);
}

TEST(TransmitLines, KeepRoomForAnswersAndSendWholeLines) {
  static TransmitLines lines;
  static char out[8192];
  static char state[500];
  std::memset(state, 's', sizeof state);
  for (int i = 0; i < 20; ++i) lines.put_state(Text(state, sizeof state));
  const std::uint32_t before = lines.dropped();
  lines.put("answer");
  EXPECT(lines.dropped() == before);
  const Text sent = drain(lines, out, sizeof out);
  EXPECT(sent.size() % (sizeof state + 2) == sizeof("answer\r\n") - 1);
}

TEST(UdpFrames, AnswerArpForTheirAddressOnly) {
  static End end;
  EXPECT(end.arp_of_host().reply_size == UdpFrames::min_frame);
  EXPECT(end.reply[21] == 2 && end.reply[5] == 2 && end.reply[11] == 1 && end.reply[31] == 15);
  end.frame[41] = 16;
  EXPECT(end.board.take(end.frame, 42, end.reply).reply_size == 0);
}

TEST(UdpFrames, ReceiveADatagramAndAnswerItsSender) {
  static End end;
  const std::size_t size = question(end.frame);
  const UdpFrames::Arrival arrival = end.board.take(end.frame, size, end.reply);
  EXPECT(arrival.from == asker() && arrival.datagram == Text("H:R4"));
  EXPECT(end.board.write(arrival.from, "answer", end.frame) == UdpFrames::min_frame);
  // The receiver of the answer checks both checksums.
  UdpFrames host(0x0A000202, 5000);
  const UdpFrames::Arrival heard = host.take(end.frame, UdpFrames::min_frame, end.reply);
  EXPECT(heard.datagram == Text("answer"));
  EXPECT(heard.from.host == 0x020F && heard.from.port == board_port);
  EXPECT(host.bad() == 0);
}

TEST(UdpFrames, DropDamagedTruncatedAndForeignFrames) {
  static End end;
  const auto refused = [](std::size_t at, std::uint8_t value) {
    const std::size_t size = question(end.frame);
    end.frame[at] = value;
    return end.board.take(end.frame, size, end.reply).from.host == 0;
  };
  EXPECT(refused(22, 63));    // a wrong IP checksum
  EXPECT(refused(37, 0xE3));  // another port
  EXPECT(refused(39, 13));    // a length greater than the packet
  EXPECT(refused(41, 1));     // a wrong UDP checksum
  EXPECT(refused(14, 0x65));  // not IPv4
  const std::size_t size = question(end.frame);
  for (std::size_t cut = 0; cut < size; ++cut) {
    EXPECT(end.board.take(end.frame, cut, end.reply).from.host == 0);
  }
  EXPECT(!refused(0, 0x52));
}
