// SPDX-License-Identifier: GPL-3.0-or-later
// pcapng of a recording and back, and captures of other programs.
#include <gtest/gtest.h>

#include "converted.hpp"
#include "tests/support/problems.hpp"
#include "tools/r4/formats/byte_order.hpp"
#include "tools/r4/formats/packets/pcap_source.hpp"

namespace r4::test {
namespace {

using tool::append_number;
using tool::ByteOrder;

// A pcap in that order of bytes, of one packet of that link type.
std::string pcap(ByteOrder order, std::uint32_t link, const std::string& packet,
                 std::uint32_t magic = 0xA1B2C3D4, std::uint32_t cut_from = 0) {
  std::string file;
  append_number(file, magic, order);
  append_number(file, std::uint16_t{2}, order);
  append_number(file, std::uint16_t{4}, order);
  append_number(file, std::uint64_t{0}, order);
  append_number(file, std::uint32_t{262144}, order);
  append_number(file, link, order);
  append_number(file, std::uint32_t{1795468293}, order);
  append_number(file, std::uint32_t{404765}, order);
  append_number(file, static_cast<std::uint32_t>(packet.size()), order);
  append_number(file, static_cast<std::uint32_t>(std::max<std::size_t>(cut_from, packet.size())),
                order);
  return file + packet;
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

TEST(Pcapng, GivesTheRecordingBackByteByByte) {
  for (const std::string& native :
       {recorded_capture(), recorded_capture("can://can0?node=3"), generated_recording(3, 5000),
        generated_recording(2, 100'000)}) {
    const std::string packets = converted(native, ".r4log", ".pcapng").bytes;
    for (const std::size_t piece : {1, 13, 4096, 10'000'000}) {
      if (piece < packets.size() / 100'000) continue;
      const Converted back = converted(packets, ".pcapng", ".r4log", piece);
      EXPECT_EQ(back.bytes, native) << piece;
      EXPECT_TRUE(back.damage.empty());
    }
  }
}

TEST(Pcapng, LosesTheDamagedBlocksAlone) {
  const std::string native = recorded_capture();
  const std::string packets = converted(native, ".r4log", ".pcapng").bytes;
  const auto lines = std::count(native.begin(), native.end(), '\n');
  // Wherever a byte is wrong behind the interfaces: at most two records are missing, and it is told.
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

TEST(Pcapng, ReadsAllThatIsThereOfATornFile) {
  const std::string native = recorded_capture();
  const std::string packets = converted(native, ".r4log", ".pcapng").bytes;
  for (std::size_t size = packets.size() - 400; size < packets.size(); size += 3) {
    const Converted back = converted(packets.substr(0, size), ".pcapng", ".r4log");
    EXPECT_TRUE(native.starts_with(back.bytes));
    EXPECT_GT(back.bytes.size(), native.size() - 1000);
    EXPECT_LE(back.damage.size(), 1);
  }
}

TEST(Pcap, ReadsUdpOfEitherOrderFromEveryKindOfLink) {
  const std::string state = captured_state();
  const std::string packet = ipv4(udp(2018, 2390, state + "\r\n"));
  const std::string ethernet = std::string(12, 'm') + std::string("\x08\0", 2) + packet;
  const std::string tagged = std::string(12, 'm') + std::string("\x81\0\0\x05\x08\0", 6) + packet;
  const std::string sll = std::string(14, 's') + std::string("\x08\0", 2) + packet;
  const std::string sll2 = std::string("\x08\0", 2) + std::string(18, 's') + packet;
  const std::vector<std::pair<std::uint32_t, std::string>> links{
      {1, ethernet}, {1, tagged}, {0, std::string(4, 'n') + packet}, {101, packet}, {228, packet},
      {113, sll},    {276, sll2}};
  for (const auto& [link, bytes] : links) {
    for (const ByteOrder order : {ByteOrder::little, ByteOrder::big}) {
      const std::string native = native_of(pcap(order, link, bytes));
      EXPECT_TRUE(contains(native, "# wire 1 udp://10.0.0.7\n")) << link;
      EXPECT_TRUE(contains(native, "1795468293.404765 1< " + state + "\n")) << link;
    }
  }
}

TEST(Pcap, ReadsBothDirectionsAndPassesOverOthers) {
  const auto one = [](std::uint16_t from, std::uint16_t to) {
    return native_of(pcap(ByteOrder::little, 228, ipv4(udp(from, to, "x")), 0xA1B23C4D));
  };
  EXPECT_TRUE(contains(one(2390, 2018), "# wire 1 udp://10.0.0.9\n"));
  EXPECT_TRUE(contains(one(2390, 2018), "1795468293.000404 1> x\n"));  // in nanoseconds
  EXPECT_FALSE(one(53, 4000).find("# wire") != std::string::npos);
}

TEST(Pcap, ReadsFramesOfSocketCan) {
  std::string packet;
  append_number(packet, std::uint32_t{0x183}, ByteOrder::big);
  packet += std::string(
      "\x04\0\0\0\x03"
      "abc",
      8);
  EXPECT_TRUE(
      contains(native_of(pcap(ByteOrder::little, 227, packet)), "1795468293.404765 1> abc\n"));
}

TEST(Pcap, TellsThePlaceOfWhatIsCutOrTooLong) {
  const std::string packet = ipv4(udp(2018, 2390, captured_state()));
  const Converted cut = converted(
      pcap(ByteOrder::little, 228, packet.substr(0, 90), 0xA1B2C3D4, 184), ".pcap", ".r4log");
  ASSERT_EQ(cut.damage.size(), 1);
  EXPECT_EQ(cut.damage[0].offset, 24);
  std::string huge = pcap(ByteOrder::little, 228, packet);
  huge.replace(32, 4, "\xFF\xFF\xFF\x7F");
  const Converted none = converted(huge, ".pcap", ".r4log");
  ASSERT_EQ(none.damage.size(), 1);
  EXPECT_TRUE(contains(none.damage[0].reason, "no packet is that long"));
}

TEST(Pcap, RefusesWhatIsNoCapture) {
  for (const std::string& file :
       {std::string(), std::string("\x0A\x0D\x0D\x0A"), std::string(100, 'x'),
        std::string("\x0A\x0D\x0D\x0A") + std::string(100, '\0')}) {
    EXPECT_EQ(problem_of([&] { converted(file, ".pcapng", ".r4log"); }).reason,
              "no capture of packets");
  }
}

}  // namespace
}  // namespace r4::test
