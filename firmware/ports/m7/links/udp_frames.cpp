// SPDX-License-Identifier: GPL-3.0-or-later
#include "udp_frames.hpp"

namespace r4 {
namespace m7 {

namespace {

// Offsets and sizes in a frame.
constexpr std::size_t ethernet_type = 12;
constexpr std::size_t ip = 14;
constexpr std::size_t arp = 14;
constexpr std::size_t arp_size = 28;
constexpr std::size_t ip_size = 20;
constexpr std::size_t udp_size = 8;

constexpr std::uint32_t type_ip = 0x0800;
constexpr std::uint32_t type_arp = 0x0806;
constexpr std::uint32_t protocol_udp = 17;
constexpr std::uint32_t arp_request = 1;

std::uint32_t get16(const std::uint8_t* at) {
  return static_cast<std::uint32_t>(at[0] << 8 | at[1]);
}
std::uint32_t get32(const std::uint8_t* at) { return get16(at) << 16 | get16(at + 2); }
void put16(std::uint8_t* at, std::uint32_t value) {
  at[0] = static_cast<std::uint8_t>(value >> 8);
  at[1] = static_cast<std::uint8_t>(value);
}
void put32(std::uint8_t* at, std::uint32_t value) {
  put16(at, value >> 16);
  put16(at + 2, value & 0xFFFF);
}

// Sum of 16-bit words (RFC 1071).
std::uint32_t sum(const std::uint8_t* at, std::size_t size, std::uint32_t start) {
  std::uint32_t total = start;
  for (; size > 1; size -= 2, at += 2) total += get16(at);
  if (size == 1) total += static_cast<std::uint32_t>(*at << 8);
  return total;
}
std::uint32_t fold(std::uint32_t total) {
  while (total >> 16 != 0) total = (total & 0xFFFF) + (total >> 16);
  return ~total & 0xFFFF;
}

// The checksum over UDP header, data and IP pseudo header (RFC 768).
std::uint32_t udp_checksum(const std::uint8_t* ip_header, const std::uint8_t* udp,
                           std::size_t size) {
  const std::uint32_t pseudo =
      sum(ip_header + 12, 8, protocol_udp + static_cast<std::uint32_t>(size));
  return fold(sum(udp, size, pseudo));
}

}  // namespace

std::size_t UdpFrames::answer_arp(const std::uint8_t* frame, std::size_t size,
                                  std::uint8_t* reply) {
  const std::uint8_t* const request = frame + arp;
  if (size < arp + arp_size || get32(request) != 0x00010800 || get16(request + 4) != 0x0604 ||
      get16(request + 6) != arp_request || get32(request + 24) != address_) {
    return 0;
  }
  std::memset(reply, 0, min_frame);
  std::memcpy(reply, request + 8, 6);
  std::memcpy(reply + 6, mac_.bytes, 6);
  put16(reply + ethernet_type, type_arp);
  put32(reply + arp, 0x00010800);
  put32(reply + arp + 4, 0x06040002);
  std::memcpy(reply + arp + 8, mac_.bytes, 6);
  put32(reply + arp + 14, address_);
  std::memcpy(reply + arp + 18, request + 8, 10);
  return min_frame;
}

Text UdpFrames::peek(const std::uint8_t* frame, std::size_t size) {
  if (size < ip + ip_size || get16(frame + ethernet_type) != type_ip) return Text();
  const std::size_t header_size = std::size_t{frame[ip] & 0xFU} * 4;
  const std::size_t begin = ip + header_size + udp_size;
  if (frame[ip + 9] != protocol_udp || begin > size) return Text();
  const std::size_t udp_total = get16(frame + ip + header_size + 4);
  if (udp_total < udp_size || begin + udp_total - udp_size > size) return Text();
  return Text(reinterpret_cast<const char*>(frame) + begin, udp_total - udp_size);
}

UdpFrames::Arrival UdpFrames::take(const std::uint8_t* frame, std::size_t size,
                                   std::uint8_t* reply) {
  Arrival arrival;
  if (size < ip) return arrival;
  const std::uint32_t type = get16(frame + ethernet_type);
  if (type == type_arp) arrival.reply_size = answer_arp(frame, size, reply);
  if (type != type_ip || size < ip + ip_size) return arrival;

  const std::uint8_t* const header = frame + ip;
  const std::size_t header_size = std::size_t{header[0] & 0xFU} * 4;
  const std::size_t total = get16(header + 2);
  if (header[0] >> 4 != 4 || header_size < ip_size || total < header_size + udp_size ||
      ip + total > size || fold(sum(header, header_size, 0)) != 0) {
    ++bad_;
    return arrival;
  }
  constexpr std::uint32_t fragment = 0x3FFF;  // more fragments, or not the first
  const std::uint32_t from = get32(header + 12);
  if (header[9] != protocol_udp || (get16(header + 6) & fragment) != 0 ||
      get32(header + 16) != address_ || !is_neighbour(from) || (from & 0xFFFF) == 0) {
    return arrival;
  }
  const std::uint8_t* const udp = header + header_size;
  const std::size_t length = get16(udp + 4);
  if (get16(udp + 2) != port_ || get16(udp) == 0) return arrival;
  if (length < udp_size || length > total - header_size ||
      (get16(udp + 6) != 0 && udp_checksum(header, udp, length) != 0)) {
    ++bad_;
    return arrival;
  }
  std::memcpy(arrival.from.mac.bytes, frame + 6, sizeof arrival.from.mac.bytes);
  arrival.from.host = static_cast<std::uint16_t>(from);
  arrival.from.port = static_cast<std::uint16_t>(get16(udp));
  arrival.datagram = Text(reinterpret_cast<const char*>(udp + udp_size), length - udp_size);
  return arrival;
}

std::size_t UdpFrames::write(const UdpAddress& to, Text datagram, std::uint8_t* frame) {
  if (datagram.size() > max_datagram) return 0;
  const std::uint32_t udp_length = static_cast<std::uint32_t>(udp_size + datagram.size());
  std::memcpy(frame, to.mac.bytes, 6);
  std::memcpy(frame + 6, mac_.bytes, 6);
  put16(frame + ethernet_type, type_ip);
  std::uint8_t* const header = frame + ip;
  put16(header, 0x4500);
  put16(header + 2, ip_size + udp_length);
  put16(header + 4, identification_++);
  put16(header + 6, 0x4000);  // don't fragment
  put16(header + 8, 64 << 8 | protocol_udp);
  put16(header + 10, 0);
  put32(header + 12, address_);
  put32(header + 16, (address_ & 0xFFFF0000U) | to.host);
  put16(header + 10, fold(sum(header, ip_size, 0)));
  std::uint8_t* const udp = header + ip_size;
  put16(udp, port_);
  put16(udp + 2, to.port);
  put16(udp + 4, udp_length);
  put16(udp + 6, 0);
  std::memcpy(udp + udp_size, datagram.data(), datagram.size());
  const std::uint32_t checksum = udp_checksum(header, udp, udp_length);
  put16(udp + 6, checksum == 0 ? 0xFFFF : checksum);
  std::size_t size = head_size + datagram.size();
  for (; size < min_frame; ++size) frame[size] = 0;
  return size;
}

}  // namespace m7
}  // namespace r4
