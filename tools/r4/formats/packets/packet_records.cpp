// SPDX-License-Identifier: GPL-3.0-or-later
#include "packet_records.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "../byte_order.hpp"
#include "../conversion.hpp"
#include "packets.hpp"
#include "pcapng_sink.hpp"
#include "protocol/datagram/numbers.hpp"

namespace r4::tool {
namespace {

constexpr std::uint16_t ether_ipv4 = 0x0800;
constexpr std::uint16_t ether_ipv6 = 0x86DD;
constexpr std::uint16_t ether_can = 0x000C;  // as Linux has it in "cooked" captures
constexpr std::uint16_t ether_can_fd = 0x000D;
// More boards than that are on no network.
constexpr std::size_t most_wires = 1000;

// SocketCAN (linux/can.h), in the order of the network.
constexpr std::uint32_t can_extended = 0x80000000;
constexpr std::uint32_t can_remote = 0x40000000;
constexpr std::uint32_t can_error = 0x20000000;
constexpr std::size_t can_header = 8;

std::uint16_t word(std::string_view bytes, std::size_t at) {
  return read_number<std::uint16_t>(bytes.substr(at), ByteOrder::big);
}

std::uint8_t byte(std::string_view bytes, std::size_t at) {
  return static_cast<std::uint8_t>(bytes[at]);
}

std::string address_text(int family, std::string_view bytes) {
  std::array<char, INET6_ADDRSTRLEN> text{};
  ::inet_ntop(family, bytes.data(), text.data(), text.size());
  return family == AF_INET6 ? fmt::format("[{}]", text.data()) : text.data();
}

std::string_view without_end(std::string_view datagram) {
  while (datagram.ends_with('\r') || datagram.ends_with('\n')) datagram.remove_suffix(1);
  return datagram;
}

}  // namespace

void PacketRecords::on_packet(const PacketInterface& interface, const Packet& packet) {
  const std::string_view bytes = packet.bytes;
  if (interface.description == lines_interface) return on_line(packet);
  if (interface.description.starts_with(wire_interface)) {
    return on_own(std::string_view(interface.description).substr(wire_interface.size()), packet);
  }
  switch (interface.link_type) {
    case link_ethernet: {
      std::size_t at = 12;
      // Tags of a VLAN, at most two.
      for (int tags = 0; tags < 2 && bytes.size() >= at + 2; ++tags, at += 4) {
        if (word(bytes, at) != 0x8100 && word(bytes, at) != 0x88A8) break;
      }
      if (bytes.size() < at + 2) return;
      return on_protocol(word(bytes, at), bytes.substr(at + 2), interface.name, packet);
    }
    case link_null:
    case link_loop:
      return on_ip(bytes.substr(std::min<std::size_t>(4, bytes.size())), packet);
    case link_raw:
    case link_ipv4:
    case link_ipv6:
      return on_ip(bytes, packet);
    case link_linux_sll:
      if (bytes.size() < 16) return;
      return on_protocol(word(bytes, 14), bytes.substr(16), interface.name, packet);
    case link_linux_sll2:
      if (bytes.size() < 20) return;
      return on_protocol(word(bytes, 0), bytes.substr(20), interface.name, packet);
    case link_socketcan:
      return on_can(interface.name, bytes, packet);
    default:
      return;
  }
}

void PacketRecords::on_protocol(std::uint16_t protocol, std::string_view bytes,
                                std::string_view interface, const Packet& packet) {
  if (protocol == ether_ipv4 || protocol == ether_ipv6) return on_ip(bytes, packet);
  if (protocol == ether_can || protocol == ether_can_fd) return on_can(interface, bytes, packet);
}

// A line of the native format, as PcapngSink writes it: behind the tags, of which a zero is the last.
void PacketRecords::on_line(const Packet& packet) {
  std::string_view bytes = packet.bytes;
  while (bytes.size() >= 4) {
    const std::uint16_t tag = word(bytes, 0);
    bytes.remove_prefix(std::min<std::size_t>(4 + word(bytes, 2), bytes.size()));
    if (tag == 0) break;
  }
  if (packet.cut) return damage(packet, "the packet is cut");
  const char* const problem = tell_line(bytes, line_, handler_);
  if (problem != nullptr) damage(packet, problem);
}

// A datagram of that wire, as PcapngSink writes it.
void PacketRecords::on_own(std::string_view wire, const Packet& packet) {
  Udp udp;
  std::uint32_t number = 0;
  if (!parse_number(Text(wire), number) || number > 65535 || !read_ip(packet.bytes, udp)) {
    return damage(packet, "no datagram of a recording");
  }
  if (packet.cut || udp.cut) return damage(packet, "the packet is cut");
  const bool to_board = udp.from == made_up_host_text;
  handler_.on_record({packet.time, static_cast<std::uint16_t>(number),
                      to_board ? RecordKind::to_board : RecordKind::from_board, udp.payload});
}

// IPv4 or IPv6 with UDP in it, whole or the first of its fragments.
bool PacketRecords::read_ip(std::string_view bytes, Udp& out) {
  if (bytes.empty()) return false;
  const int version = byte(bytes, 0) >> 4;
  if (version == 4) {
    const std::size_t header = 4U * (byte(bytes, 0) & 15U);
    if (header < 20 || bytes.size() < header + udp_header) return false;
    const bool fragment = (word(bytes, 6) & 0x1FFF) != 0;
    if (byte(bytes, 9) != udp_protocol || fragment) return false;
    out.from = address_text(AF_INET, bytes.substr(12, 4));
    out.to = address_text(AF_INET, bytes.substr(16, 4));
    bytes.remove_prefix(header);
  } else if (version == 6) {
    if (bytes.size() < 40 + udp_header || byte(bytes, 6) != udp_protocol) return false;
    out.from = address_text(AF_INET6, bytes.substr(8, 16));
    out.to = address_text(AF_INET6, bytes.substr(24, 16));
    bytes.remove_prefix(40);
  } else {
    return false;
  }
  out.from_port = word(bytes, 0);
  out.to_port = word(bytes, 2);
  const std::size_t size = word(bytes, 4);
  if (size < udp_header) return false;
  out.cut = size > bytes.size();
  out.payload = bytes.substr(udp_header, size - udp_header);
  return true;
}

void PacketRecords::on_ip(std::string_view bytes, const Packet& packet) {
  Udp udp;
  if (!read_ip(bytes, udp)) return;
  const bool from_board = udp.from_port == port_;
  if (!from_board && udp.to_port != port_) return;
  if (udp.cut) return damage(packet, "the packet is cut: capture it whole, tcpdump -s 0");
  const std::uint16_t wire = wire_of(from_board ? udp.from : udp.to);
  if (wire == no_wire) return damage(packet, "more than 1000 boards");
  handler_.on_record({packet.time, wire, from_board ? RecordKind::from_board : RecordKind::to_board,
                      without_end(udp.payload)});
}

void PacketRecords::on_can(std::string_view interface, std::string_view bytes,
                           const Packet& packet) {
  if (bytes.size() < can_header) return damage(packet, "a frame without a header");
  const auto id = read_number<std::uint32_t>(bytes, ByteOrder::big);
  if ((id & can_error) != 0) return;
  const std::size_t size = byte(bytes, 4);
  CanFrame frame{};
  frame.extended = (id & can_extended) != 0;
  frame.remote = (id & can_remote) != 0;
  frame.id = id & (frame.extended ? 0x1FFFFFFF : max_can_id);
  frame.fd = size > max_classic_size || (byte(bytes, 5) & 4) != 0;
  if (size > max_fd_size || bytes.size() < can_header + (frame.remote ? 0 : size)) {
    return damage(packet, "the frame is cut");
  }
  frame.size = static_cast<std::uint8_t>(size);
  if (!has_valid_size(frame)) return damage(packet, "no frame has that many bytes");
  if (!frame.remote) std::copy_n(bytes.data() + can_header, size, frame.data);
  bus_.on_frame(interface.empty() ? "can0" : interface, frame,
                {0, packet.offset, static_cast<std::uint64_t>(packet.time.count()), {}});
}

std::uint16_t PacketRecords::wire_of(const std::string& address) {
  const auto known = wires_.find(address);
  if (known != wires_.end()) return known->second;
  if (wires_.size() == most_wires) return no_wire;
  const std::string url = "udp://" + address;
  const std::uint16_t wire =
      bus_.add_wire(port_ == board_port ? url : fmt::format("{}:{}", url, port_));
  wires_.emplace(address, wire);
  return wire;
}

void PacketRecords::damage(const Packet& packet, std::string_view reason) {
  handler_.on_damage({RecordingDamage::Kind::line, 0, packet.offset, reason});
}

}  // namespace r4::tool
