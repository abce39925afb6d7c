// SPDX-License-Identifier: GPL-3.0-or-later
#include "packet_records.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <functional>
#include <utility>
#include <vector>

#include "../../shell/number.hpp"
#include "packets.hpp"
#include "pcapng_sink.hpp"
#include "r4link/error.hpp"

namespace r4::tool {
namespace {

constexpr std::uint16_t ether_ipv4 = 0x0800;
constexpr std::uint16_t ether_ipv6 = 0x86DD;
constexpr std::uint16_t ether_can = 0x000C;  // in Linux "cooked" captures
constexpr std::uint16_t ether_can_fd = 0x000D;
constexpr std::size_t most_paths = 1000;

// Flags of an id in SocketCAN (linux/can.h), in network byte order.
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

bool is_vlan_tag(std::uint16_t type) { return type == 0x8100 || type == 0x88A8 || type == 0x9100; }

// True for a possible id: 11 bits; extended: 29 bits; error frame: only the ten error classes.
bool can_be_id(std::uint32_t id) {
  constexpr std::uint32_t flags = can_extended | can_remote | can_error;
  if ((id & can_error) != 0) return (id & ~flags) < 0x400;
  return (id & can_extended) != 0 || (id & ~flags) <= max_can_id;
}

std::string link_name(std::uint16_t link) {
  switch (link) {
    case 105:
      return "105 (802.11)";
    case 119:
    case 127:
    case 192:
      return fmt::format("{} (802.11 in monitor mode)", link);
    case 258:
      return "258 (pktap)";
    default:
      return std::to_string(link);
  }
}

// The most frequent numbers, at most five: "3018, 2390 and 4 more".
template <class Name>
std::string listed(const std::map<std::uint16_t, std::uint64_t>& counts, Name name) {
  constexpr std::size_t most = 5;
  std::vector<std::pair<std::uint64_t, std::uint16_t>> order;
  order.reserve(counts.size());
  for (const auto& [number, count] : counts) order.emplace_back(count, number);
  std::sort(order.begin(), order.end(), std::greater<>());
  std::string text;
  for (std::size_t i = 0; i < std::min(most, order.size()); ++i) {
    text += (i == 0 ? "" : ", ") + name(order[i].second);
  }
  return order.size() <= most ? text : fmt::format("{} and {} more", text, order.size() - most);
}

std::string_view without_end(std::string_view datagram) {
  while (datagram.ends_with('\r') || datagram.ends_with('\n')) datagram.remove_suffix(1);
  return datagram;
}

}  // namespace

void PacketRecords::on_packet(const PacketInterface& interface, const Packet& packet) {
  const std::string_view bytes = packet.bytes;
  ++packets_;
  if (interface.description == lines_interface) return on_line(interface, packet);
  if (interface.description.starts_with(path_interface)) return on_own(interface, packet);
  switch (interface.link_type) {
    case link_ethernet: {
      std::size_t at = 12;
      while (bytes.size() >= at + 2 && is_vlan_tag(word(bytes, at))) at += 4;
      if (bytes.size() < at + 2) return;
      const std::uint16_t protocol = word(bytes, at);
      if (protocol == ether_ipv4 || protocol == ether_ipv6) on_ip(bytes.substr(at + 2), packet);
      return;
    }
    case link_null:
    case link_loop:
      return on_ip(bytes.substr(std::min<std::size_t>(4, bytes.size())), packet);
    case link_raw:
    case link_raw_bsd:
    case link_raw_openbsd:
    case link_ipv4:
    case link_ipv6:
      return on_ip(bytes, packet);
    case link_linux_sll:
      if (bytes.size() < 16) return;
      return on_cooked(word(bytes, 14), bytes.substr(16), interface.name, packet);
    case link_linux_sll2:
      if (bytes.size() < 20) return;
      return on_cooked(
          word(bytes, 0), bytes.substr(20),
          fmt::format("if{}", read_number<std::uint32_t>(bytes.substr(4), ByteOrder::big)), packet);
    case link_socketcan:
      if (bytes.size() < can_header) return damage(packet, "a frame without a header");
      return on_can(interface.name, read_number<std::uint32_t>(bytes, ByteOrder::big), bytes,
                    packet);
    default:
      ++unread_links_[interface.link_type];
      return;
  }
}

// Decides between recording and capture. A mixture would use path numbers twice.
void PacketRecords::be(Kind kind) {
  told_ = true;
  const bool other = kind_ != Kind::none ? kind_ != kind : kind == Kind::recorded && bus_.told();
  if (other) lines_.on_sign_of_mixture();
  kind_ = kind;
}

void PacketRecords::finish(bool any_damage) {
  bus_.finish();
  if (told_ || bus_.told() || any_damage) return;
  std::string reason = "does not contain a datagram of a board: ";
  if (!unread_links_.empty()) {
    reason += "packets have link types that r4 does not read: " + listed(unread_links_, link_name);
  } else if (!ports_.empty()) {
    reason += fmt::format("packets do not use UDP port {}, but: {}", port_,
                          listed(ports_, [](std::uint16_t port) { return std::to_string(port); }));
  } else {
    reason +=
        fmt::format("{} packets are neither UDP nor frames of a board on a CAN bus", packets_);
  }
  const char* const fix =
      !ports_.empty() ? "name the boards' port: r4 convert --port PORT"
      : !unread_links_.empty()
          ? "capture on the interface that connects this computer to the board: tcpdump -i wlan0 "
            "-w FILE udp port 2018"
          : "capture while the board sends: tcpdump -i any -w FILE udp port 2018";
  throw Error(ErrorKind::data, name_, reason, fix);
}

void PacketRecords::on_cooked(std::uint16_t protocol, std::string_view bytes,
                              std::string_view interface, const Packet& packet) {
  if (protocol == ether_ipv4 || protocol == ether_ipv6) return on_ip(bytes, packet);
  if (protocol != ether_can && protocol != ether_can_fd) return;
  if (bytes.size() < can_header) return damage(packet, "a frame without a header");
  on_can(interface, cooked_id(bytes), bytes, packet);
}

// The byte order of the id in cooked captures is the capturing computer's up to libpcap 1.10.4, and
// network order later. If only one order gives a possible id, that order is used, else the order of
// the previous frame. The first frame prefers an 11-bit id, because only numbered stops have 29.
std::uint32_t PacketRecords::cooked_id(std::string_view bytes) {
  const auto big = read_number<std::uint32_t>(bytes, ByteOrder::big);
  const auto little = read_number<std::uint32_t>(bytes, ByteOrder::little);
  if (can_be_id(big) != can_be_id(little)) {
    cooked_order_ = can_be_id(big) ? ByteOrder::big : ByteOrder::little;
  } else if (!cooked_order_) {
    const bool only_little = (big & can_extended) != 0 && (little & can_extended) == 0;
    cooked_order_ = only_little ? ByteOrder::little : ByteOrder::big;
  }
  return cooked_order_ == ByteOrder::big ? big : little;
}

// A line of the native format from PcapngSink, after the tags; tag 0 is the last.
void PacketRecords::on_line(const PacketInterface& interface, const Packet& packet) {
  std::string_view bytes = packet.bytes;
  while (bytes.size() >= 4) {
    const std::uint16_t tag = word(bytes, 0);
    bytes.remove_prefix(std::min<std::size_t>(4 + word(bytes, 2), bytes.size()));
    if (tag == 0) break;
  }
  if (packet.cut) return damage(packet, "the packet is cut");
  be(Kind::recorded);
  const char* const problem = lines_.on_line(bytes, interface.number);
  if (problem != nullptr) damage(packet, problem);
}

void PacketRecords::on_own(const PacketInterface& interface, const Packet& packet) {
  const auto path = std::string_view(interface.description).substr(path_interface.size());
  Udp udp;
  const auto number = number_in<std::uint16_t>(path);
  if (!number || !read_ip(packet.bytes, udp)) {
    return damage(packet, "the packet is not a datagram of a recording");
  }
  if (packet.cut || udp.cut) return damage(packet, "the packet is cut");
  const bool to_board = udp.from == made_up_host_text;
  be(Kind::recorded);
  lines_.on_record(
      {packet.time, *number, to_board ? RecordKind::to_board : RecordKind::from_board, udp.payload},
      interface.number, interface.name);
}

bool PacketRecords::read_ip(std::string_view bytes, Udp& out) {
  if (bytes.empty()) return false;
  const int version = byte(bytes, 0) >> 4;
  if (version == 4) {
    const std::size_t header = 4U * (byte(bytes, 0) & 15U);
    if (header < 20 || bytes.size() < header + udp_header) return false;
    const bool fragment = (word(bytes, 6) & 0x1FFF) != 0;
    if (byte(bytes, 9) != udp_protocol || fragment) return false;
    out.id = word(bytes, 4);
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
  if (!from_board && udp.to_port != port_) {
    ++ports_[udp.from_port];
    ++ports_[udp.to_port];
    return;
  }
  if (udp.cut) return damage(packet, "the packet is cut: capture whole packets with tcpdump -s 0");
  if (is_repeated(udp, packet.time)) return;
  be(Kind::captured);
  const std::uint16_t path = path_of(from_board ? udp.from : udp.to);
  if (path == no_path) return damage(packet, "a packet of a board after the first 1000");
  visitor_.on_record({packet.time, path, from_board ? RecordKind::from_board : RecordKind::to_board,
                      without_end(udp.payload)});
}

// True if the same packet was already reported. Different packets differ in the IP id, or in number
// and time of the datagram. A host repeats a text only after a time longer than these limits.
bool PacketRecords::is_repeated(const Udp& udp, Time time) {
  constexpr Time of_an_id{500'000};
  constexpr Time without{5'000};
  const std::string all = fmt::format("{} {} {} {} {} {}", udp.from, udp.from_port, udp.to,
                                      udp.to_port, udp.id, udp.payload);
  const std::size_t hash = std::hash<std::string>()(all);
  const Time most = udp.id != 0 ? of_an_id : without;
  const bool known = std::any_of(seen_.begin(), seen_.end(), [&](const Seen& each) {
    return each.hash == hash && std::chrono::abs(time - each.time) <= most;
  });
  if (known) return true;
  seen_[next_seen_] = {hash, time};
  next_seen_ = (next_seen_ + 1) % seen_.size();
  return false;
}

void PacketRecords::on_can(std::string_view interface, std::uint32_t id, std::string_view bytes,
                           const Packet& packet) {
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
  if (!has_valid_size(frame)) return damage(packet, "the number of bytes is not valid for a frame");
  if (!frame.remote) std::copy_n(bytes.data() + can_header, size, frame.data);
  if (kind_ == Kind::recorded) be(Kind::captured);
  bus_.on_frame(interface.empty() ? "can0" : interface, frame,
                {0, packet.offset, static_cast<std::uint64_t>(packet.time.count()), {}});
}

std::uint16_t PacketRecords::path_of(const std::string& address) {
  const auto known = paths_.find(address);
  if (known != paths_.end()) return known->second;
  if (paths_.size() == most_paths) return no_path;
  const std::string url = "udp://" + address;
  const std::uint16_t path =
      bus_.add_path(port_ == board_port ? url : fmt::format("{}:{}", url, port_));
  paths_.emplace(address, path);
  return path;
}

void PacketRecords::damage(const Packet& packet, std::string_view reason) {
  told_ = true;
  lines_.on_damage();
  visitor_.on_damage({RecordingDamage::Kind::line, 0, packet.offset, reason});
}

}  // namespace r4::tool
