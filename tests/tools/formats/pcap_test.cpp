// SPDX-License-Identifier: GPL-3.0-or-later
// Conversion of a recording to pcapng and back, and captures of other programs.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "converted.hpp"
#include "tests/support/problems.hpp"
#include "tools/r4/formats/byte_order.hpp"
#include "tools/r4/formats/packets/pcap_source.hpp"

namespace r4::test {
namespace {

using tool::append_number;
using tool::ByteOrder;

// A packet record of a pcap file.
std::string in_pcap(ByteOrder order, const std::string& packet, std::uint32_t us = 404765,
                    std::uint32_t cut_from = 0) {
  std::string file;
  append_number(file, std::uint32_t{1795468293}, order);
  append_number(file, us, order);
  append_number(file, static_cast<std::uint32_t>(packet.size()), order);
  append_number(file, static_cast<std::uint32_t>(std::max<std::size_t>(cut_from, packet.size())),
                order);
  return file + packet;
}

// A pcap file in this byte order, with one packet of this link type.
std::string pcap(ByteOrder order, std::uint32_t link, const std::string& packet,
                 std::uint32_t magic = 0xA1B2C3D4, std::uint32_t cut_from = 0) {
  std::string file;
  append_number(file, magic, order);
  append_number(file, std::uint16_t{2}, order);
  append_number(file, std::uint16_t{4}, order);
  append_number(file, std::uint64_t{0}, order);
  append_number(file, std::uint32_t{262144}, order);
  append_number(file, link, order);
  return file + in_pcap(order, packet, 404765, cut_from);
}

std::string udp(std::uint16_t from, std::uint16_t to, const std::string& payload) {
  std::string bytes;
  append_number(bytes, from, ByteOrder::big);
  append_number(bytes, to, ByteOrder::big);
  append_number(bytes, static_cast<std::uint16_t>(8 + payload.size()), ByteOrder::big);
  append_number(bytes, std::uint16_t{0});
  return bytes + payload;
}

std::string ipv4(const std::string& payload) {
  std::string bytes("\x45\0\0\0\0\0\x40\0\x40\x11\0\0\x0A\0\0\x07\x0A\0\0\x09", 20);
  return bytes + payload;
}

std::string native_of(const std::string& file) {
  const Converted result = converted(file, ".pcap", ".r4log", 5);
  EXPECT_TRUE(result.damage.empty());
  return result.bytes;
}

TEST(Pcapng, LosesOnlyDamagedBlocks) {
  const std::string native = recorded_capture();
  const std::string packets = converted(native, ".r4log", ".pcapng").bytes;
  const auto lines = std::count(native.begin(), native.end(), '\n');
  // A wrong byte at any place after the interfaces. At most two records are missing, and the damage
  // is reported.
  for (std::size_t at = packets.find("AIN24"); at < packets.size(); at += 7) {
    std::string damaged = packets;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x55);
    const Converted back = converted(damaged, ".pcapng", ".r4log");
    EXPECT_GE(std::count(back.bytes.begin(), back.bytes.end(), '\n'), lines - 2) << at;
    for (const auto& each : back.damage) {
      EXPECT_LE(each.offset, at) << at;
      EXPECT_GE(each.offset + 300, at) << at;
    }
  }
}

TEST(Pcapng, ReadsTheWholeBlocksOfATornFile) {
  const std::string native = recorded_capture();
  const std::string packets = converted(native, ".r4log", ".pcapng").bytes;
  for (std::size_t size = packets.size() - 400; size < packets.size(); size += 3) {
    const Converted back = converted(packets.substr(0, size), ".pcapng", ".r4log");
    EXPECT_TRUE(native.starts_with(back.bytes));
    EXPECT_GT(back.bytes.size(), native.size() - 1000);
    EXPECT_LE(back.damage.size(), 1);
  }
}

TEST(Pcap, ReadsUdpOfEitherByteOrderFromEveryLinkType) {
  const std::string state = captured_state();
  const std::string packet = ipv4(udp(2018, 2390, state + "\r\n"));
  const std::string ethernet = std::string(12, 'm') + std::string("\x08\0", 2) + packet;
  const std::string tag("\x81\0\0\x05", 4);
  const std::string tagged = std::string(12, 'm') + tag + std::string("\x08\0", 2) + packet;
  const std::string thrice =
      std::string(12, 'm') + tag + tag + tag + std::string("\x08\0", 2) + packet;
  const std::string sll = std::string(14, 's') + std::string("\x08\0", 2) + packet;
  const std::string sll2 = std::string("\x08\0", 2) + std::string(18, 's') + packet;
  const std::vector<std::pair<std::uint32_t, std::string>> links{
      {1, ethernet}, {1, tagged},  {1, thrice},   {0, std::string(4, 'n') + packet},
      {12, packet},  {14, packet}, {101, packet}, {228, packet},
      {113, sll},    {276, sll2}};
  for (const auto& [link, bytes] : links) {
    for (const ByteOrder order : {ByteOrder::little, ByteOrder::big}) {
      const std::string native = native_of(pcap(order, link, bytes));
      EXPECT_TRUE(contains(native, "# path 1 udp://10.0.0.7\n")) << link;
      EXPECT_TRUE(contains(native, "1795468293.404765 1< " + state + "\n")) << link;
    }
  }
}

TEST(Pcap, ReadsBothDirectionsAndSkipsOtherPackets) {
  const auto one = [](std::uint16_t from, std::uint16_t to) {
    return native_of(pcap(ByteOrder::little, 228, ipv4(udp(from, to, "x")), 0xA1B23C4D));
  };
  EXPECT_TRUE(contains(one(2390, 2018), "# path 1 udp://10.0.0.9\n"));
  EXPECT_TRUE(contains(one(2390, 2018), "1795468293.000404 1> x\n"));  // a capture in nanoseconds
}

TEST(Pcap, RefusesACaptureWithoutABoardAndNamesItsContents) {
  const auto problem = [](const std::string& file) {
    const Problem found = problem_of([&] { converted(file, ".pcap", ".r4log"); });
    EXPECT_EQ(found.kind, ErrorKind::data);
    EXPECT_TRUE(contains(found.reason, "does not contain a datagram of a board")) << found.reason;
    return found.reason + "; " + found.fix;
  };
  const std::string state = captured_state();
  const std::string elsewhere = problem(pcap(ByteOrder::little, 228, ipv4(udp(3018, 2390, state))));
  EXPECT_TRUE(contains(elsewhere, "port 2018, but: 3018, 2390")) << elsewhere;
  EXPECT_TRUE(contains(elsewhere, "--port"));
  const std::string unread = problem(pcap(ByteOrder::little, 127, std::string(100, 'r')));
  EXPECT_TRUE(contains(unread, "link types that r4 does not read: 127 (802.11")) << unread;
  const std::string empty = pcap(ByteOrder::little, 228, "").substr(0, 24);
  EXPECT_TRUE(contains(problem(empty), "0 packets"));
}

// A SocketCAN frame whose id has this byte order.
std::string can_frame(std::uint32_t id, const std::string& data, ByteOrder order) {
  std::string packet;
  append_number(packet, id, order);
  append_number(packet, static_cast<std::uint8_t>(data.size()));
  return packet + std::string(3, '\0') + data;
}

std::string cooked(std::uint32_t interface, const std::string& frame) {
  std::string packet("\0\x0C\0\0", 4);
  append_number(packet, interface, ByteOrder::big);
  return packet + std::string(12, '\0') + frame;
}

TEST(Pcap, ReadsCanFramesOfEveryLinkTypeInEitherByteOrder) {
  const std::string data = "\3abc";
  EXPECT_TRUE(
      contains(native_of(pcap(ByteOrder::little, 227, can_frame(0x183, data, ByteOrder::big))),
               "1795468293.404765 1> abc\n"));
  for (const ByteOrder order : {ByteOrder::little, ByteOrder::big}) {
    for (const std::uint32_t node : {0U, 3U, 31U}) {
      const std::string frame = can_frame(0x180 + node, data, order);
      const std::string sll = std::string(14, '\0') + std::string("\0\x0C", 2) + frame;
      EXPECT_TRUE(contains(native_of(pcap(ByteOrder::little, 113, sll)), " 1> abc\n")) << node;
      const std::string native = native_of(pcap(ByteOrder::little, 276, cooked(4, frame)));
      EXPECT_TRUE(contains(native, fmt::format("# path 1 can://if4?node={}\n", node))) << native;
      EXPECT_TRUE(contains(native, " 1> abc\n")) << node;
    }
    // The number of a stop is valid in either byte order. An earlier frame shows the order.
    const std::string stop = can_frame(0x80400083, "", order);
    const std::string native =
        native_of(pcap(ByteOrder::little, 276, cooked(4, can_frame(0x183, data, order))) +
                  in_pcap(ByteOrder::little, cooked(4, stop)));
    EXPECT_TRUE(contains(native, " 0! stop if4\n")) << native;
  }
}

TEST(Pcap, DistinguishesTheInterfacesOfACookedCapture) {
  const auto half = [](std::uint32_t interface, const std::string& data) {
    return cooked(interface, can_frame(0x403, data, ByteOrder::little));
  };
  // Two datagrams of eight bytes at the same time, one datagram on each bus.
  std::string file = pcap(ByteOrder::little, 276, half(4, "\20\10ABCDEF"));
  for (const std::string& packet :
       {half(5, "\20\10abcdef"), half(4, "\x21GH"), half(5, "\x21gh")}) {
    file += in_pcap(ByteOrder::little, packet);
  }
  const std::string native = native_of(file);
  EXPECT_TRUE(contains(native, "# path 1 can://if4?node=3\n")) << native;
  EXPECT_TRUE(contains(native, " 1< ABCDEFGH\n"));
  EXPECT_TRUE(contains(native, "# path 2 can://if5?node=3\n"));
  EXPECT_TRUE(contains(native, " 2< abcdefgh\n"));
}

TEST(Pcap, ReadsAPacketOnceThatPassedTwoInterfaces) {
  const auto count_of = [](const std::string& second, std::uint32_t us) {
    const std::string first = ipv4(udp(2018, 2390, "PNum:1;"));
    const std::string native =
        native_of(pcap(ByteOrder::little, 228, first) + in_pcap(ByteOrder::little, second, us));
    return native.find("1< ") == native.rfind("1< ") ? 1 : 2;
  };
  std::string same = ipv4(udp(2018, 2390, "PNum:1;"));
  EXPECT_EQ(count_of(same, 404800), 1);
  same[8] = '\x3F';  // a forwarded packet has a smaller time to live
  EXPECT_EQ(count_of(same, 404800), 1);
  EXPECT_EQ(count_of(same, 504800), 2);  // a repetition of the text
  EXPECT_EQ(count_of(ipv4(udp(2018, 2390, "PNum:2;")), 404800), 2);
  same[5] = '\x07';  // the id of the IP packet
  EXPECT_EQ(count_of(same, 404800), 2);
}

// A block of pcapng.
std::string block(std::uint32_t type, std::string body) {
  body.append((4 - body.size() % 4) % 4, '\0');
  std::string bytes;
  append_number(bytes, type);
  append_number(bytes, static_cast<std::uint32_t>(body.size() + 12));
  bytes += body;
  append_number(bytes, static_cast<std::uint32_t>(body.size() + 12));
  return bytes;
}

// One packet in an obsolete block. `options`: the options of its interface.
std::string pcapng_at(std::uint64_t ticks, const std::string& options) {
  std::string section, interface, packet;
  append_number(section, std::uint32_t{0x1A2B3C4D});
  append_number(section, std::uint32_t{1});
  append_number(section, ~std::uint64_t{0});
  append_number(interface, std::uint64_t{228});
  const std::string bytes = ipv4(udp(2018, 2390, "PNum:1;"));
  append_number(packet, std::uint16_t{0});
  append_number(packet, std::uint16_t{9});  // number of lost packets
  append_number(packet, static_cast<std::uint32_t>(ticks >> 32));
  append_number(packet, static_cast<std::uint32_t>(ticks));
  append_number(packet, static_cast<std::uint32_t>(bytes.size()));
  append_number(packet, static_cast<std::uint32_t>(bytes.size()));
  return block(0x0A0D0D0A, section) + block(1, interface + options) + block(2, packet + bytes);
}

TEST(Pcapng, ReadsObsoleteBlocksWithTimesOfEveryResolution) {
  EXPECT_TRUE(
      contains(native_of(pcapng_at(1795468293404765, "")), "1795468293.404765 1< PNum:1;\n"));
  const auto native_at = [](std::uint8_t resolution, std::uint64_t ticks) {
    std::string option;
    append_number(option, std::uint16_t{9});  // if_tsresol
    append_number(option, std::uint16_t{1});
    append_number(option, std::uint32_t{resolution});
    return native_of(pcapng_at(ticks, option));
  };
  constexpr std::uint64_t one = 1;
  EXPECT_TRUE(contains(native_at(0, 1795468293), "1795468293.000000 1<"));
  EXPECT_TRUE(contains(native_at(9, 1795468293404765999), "1795468293.404765 1<"));
  EXPECT_TRUE(contains(native_at(0x80 | 20, (one << 50) + (one << 18)), "1073741824.250000 1<"));
  // With the finest ticks, times of 64 bits end a few seconds after 1970.
  EXPECT_TRUE(contains(native_at(18, 1'500'000'000'000'000'000), "1.500000 1<"));
  EXPECT_TRUE(contains(native_at(18, 1'000'001'000'000'000'000), "1.000001 1<"));
  EXPECT_TRUE(contains(native_at(0x80 | 62, 7 * (one << 60)), "1.750000 1<"));
  EXPECT_TRUE(contains(native_at(0x80 | 62, ~std::uint64_t{0}), "3.999999 1<"));
}

std::vector<std::string> blocks_of(const std::string& file) {
  std::vector<std::string> blocks;
  for (std::size_t at = 0; at < file.size(); at += blocks.back().size()) {
    blocks.push_back(file.substr(at, tool::read_number<std::uint32_t>(file.substr(at + 4, 4))));
  }
  return blocks;
}

// The packets of two captures in turn, in the order in which mergecap writes packets with equal
// times. Each capture has its own interfaces, or both captures share the interfaces of the first.
std::string merged_by_mergecap(const std::string& a, const std::string& b, bool own) {
  std::string head = blocks_of(a)[0], packets;
  std::vector<std::string> left, right;
  std::uint32_t interfaces = 0;
  for (const std::string& each : blocks_of(a)) {
    const auto type = tool::read_number<std::uint32_t>(each);
    if (type == 1) head += each, ++interfaces;
    if (type == 6) left.push_back(each);
  }
  for (const std::string& each : blocks_of(b)) {
    const auto type = tool::read_number<std::uint32_t>(each);
    if (type == 1 && own) head += each;
    if (type != 6) continue;
    std::string moved = each, number;
    append_number(number,
                  tool::read_number<std::uint32_t>(each.substr(8)) + (own ? interfaces : 0));
    right.push_back(moved.replace(8, 4, number));
  }
  for (std::size_t i = 0; i < std::max(left.size(), right.size()); ++i) {
    if (i < left.size()) packets += left[i];
    if (i < right.size()) packets += right[i];
  }
  return head + packets;
}

TEST(Pcapng, RefusesRecordingsMergedByMergecap) {
  const auto packets = [](const std::string& url) {
    return converted(recorded_capture(url), ".r4log", ".pcapng").bytes;
  };
  for (const char* const other : {"udp://192.168.0.126", "udp://192.168.0.125"}) {
    for (const bool own : {false, true}) {
      const std::string file =
          merged_by_mergecap(packets("udp://192.168.0.125"), packets(other), own);
      const Problem problem = problem_of([&] { converted(file, ".pcapng", ".r4log"); });
      EXPECT_EQ(problem.kind, ErrorKind::data) << other;
      EXPECT_TRUE(contains(problem.reason, "several recordings are mixed")) << problem.reason;
    }
  }
  // Each capture numbers its paths separately.
  const std::string recording = packets("udp://192.168.0.125");
  std::string interface, packet;
  append_number(interface, std::uint64_t{228});
  const std::string bytes = ipv4(udp(2018, 2390, "PNum:1;"));
  append_number(packet, std::uint32_t{0});
  append_number(packet, std::uint64_t{0});
  append_number(packet, static_cast<std::uint32_t>(bytes.size()));
  append_number(packet, static_cast<std::uint32_t>(bytes.size()));
  const std::string capture =
      blocks_of(recording)[0] + block(1, interface) + block(6, packet + bytes);
  for (const std::string& file : {recording + capture, capture + recording}) {
    EXPECT_TRUE(contains(problem_of([&] { converted(file, ".pcapng", ".r4log"); }).reason,
                         "several recordings are mixed"));
  }
  // Concatenated recordings can be read, with one section for each recording.
  EXPECT_EQ(native_of(packets("udp://a") + packets("udp://b")),
            recorded_capture("udp://a") + recorded_capture("udp://b"));
}

TEST(Pcap, ReportsTheOffsetOfACutOrTooLongPacket) {
  const std::string packet = ipv4(udp(2018, 2390, captured_state()));
  const Converted cut = converted(
      pcap(ByteOrder::little, 228, packet.substr(0, 90), 0xA1B2C3D4, 184), ".pcap", ".r4log");
  ASSERT_EQ(cut.damage.size(), 1);
  EXPECT_EQ(cut.damage[0].offset, 24);
  std::string huge = pcap(ByteOrder::little, 228, packet);
  huge.replace(32, 4, "\xFF\xFF\xFF\x7F");
  const Converted none = converted(huge, ".pcap", ".r4log");
  ASSERT_EQ(none.damage.size(), 1);
  EXPECT_TRUE(contains(none.damage[0].reason, "the length of a packet is not valid"));
}

TEST(Pcap, RefusesAFileThatIsNotACapture) {
  for (const std::string& file :
       {std::string(), std::string("\x0A\x0D\x0D\x0A"), std::string(100, 'x'),
        std::string("\x0A\x0D\x0D\x0A") + std::string(100, '\0')}) {
    EXPECT_EQ(problem_of([&] { converted(file, ".pcapng", ".r4log"); }).reason,
              "is not a capture of packets");
  }
}

}  // namespace
}  // namespace r4::test
