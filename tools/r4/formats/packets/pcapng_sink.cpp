// SPDX-License-Identifier: GPL-3.0-or-later
#include "pcapng_sink.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>

#include <array>

#include "../byte_order.hpp"
#include "packets.hpp"
#include "r4link/config.hpp"
#include "r4link/discovery/url.hpp"
#include "r4link/error.hpp"

namespace r4::tool {
namespace {

constexpr std::uint16_t opt_comment = 1;
constexpr std::uint16_t shb_userappl = 4;
constexpr std::uint16_t epb_flags = 2;
constexpr std::uint32_t inbound = 1;
constexpr std::uint32_t outbound = 2;

constexpr std::uint32_t made_up_board = 0xC6120000;  // 198.18.0.0
constexpr std::uint32_t made_up_host = 0xC6130001;   // 198.19.0.1
constexpr std::uint16_t host_port = 2390;
constexpr std::size_t ip_header = 20;

// Makes Wireshark show a LINKTYPE_WIRESHARK_UPPER_PDU as syslog: tag, size, dissector; end.
constexpr std::string_view shown_as_syslog{
    "\0\x0C\0\x08"
    "syslog\0\0"
    "\0\0\0\0",
    16};

void pad(std::string& out) { out.append((4 - out.size() % 4) % 4, '\0'); }

void append_option(std::string& out, std::uint16_t code, std::string_view value) {
  append_number(out, code);
  append_number(out, static_cast<std::uint16_t>(value.size()));
  out += value;
  pad(out);
}

void begin_block(std::string& out, std::uint32_t type) {
  out.clear();
  append_number(out, type);
  append_number(out, std::uint32_t{0});
}

void end_block(std::string& out) {
  std::string size;
  append_number(size, static_cast<std::uint32_t>(out.size() + 4));
  out.replace(4, 4, size);
  out += size;
}

std::uint16_t ip_checksum(std::string_view header) {
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i < header.size(); i += 2) {
    sum += read_number<std::uint16_t>(header.substr(i), ByteOrder::big);
  }
  while (sum >> 16 != 0) sum = (sum & 0xFFFF) + (sum >> 16);
  return static_cast<std::uint16_t>(~sum);
}

// IPv4 and UDP; the UDP checksum is optional and left out.
void write_head(std::string& out, std::uint32_t from, std::uint16_t from_port, std::uint32_t to,
                std::uint16_t to_port, std::size_t payload) {
  constexpr auto big = ByteOrder::big;
  out.clear();
  append_number(out, std::uint16_t{0x4500}, big);
  append_number(out, static_cast<std::uint16_t>(ip_header + udp_header + payload), big);
  append_number(out, std::uint32_t{0x00004000}, big);  // don't fragment
  append_number(out, static_cast<std::uint16_t>(64 << 8 | udp_protocol), big);
  append_number(out, std::uint16_t{0}, big);
  append_number(out, from, big);
  append_number(out, to, big);
  std::string checksum;
  append_number(checksum, ip_checksum(out), big);
  out.replace(10, 2, checksum);
  append_number(out, from_port, big);
  append_number(out, to_port, big);
  append_number(out, static_cast<std::uint16_t>(udp_header + payload), big);
  append_number(out, std::uint16_t{0}, big);
}

}  // namespace

void PcapngSink::begin() {
  if (interfaces_ != 0) return;
  begin_block(block_, pcapng_section);
  append_number(block_, pcapng_magic);
  append_number(block_, std::uint16_t{1});  // version 1.0
  append_number(block_, std::uint16_t{0});
  append_number(block_, ~std::uint64_t{0});  // section length: unknown
  append_option(block_, opt_comment,
                "Made from a recording by r4 convert. The packet headers and the addresses in "
                "198.18.0.0/15 are invented.");
  append_option(block_, shb_userappl, "r4 " R4LINK_VERSION);
  append_number(block_, std::uint32_t{0});
  end_block(block_);
  output_.write(block_);
  add_interface(link_upper_pdu, "recording", std::string(lines_interface));
}

void PcapngSink::add_interface(std::uint16_t link_type, std::string_view name,
                               const std::string& description) {
  begin_block(block_, pcapng_interface);
  append_number(block_, link_type);
  append_number(block_, std::uint16_t{0});
  append_number(block_, std::uint32_t{0});  // no snapshot limit
  append_option(block_, pcapng_if_name, name);
  append_option(block_, pcapng_if_description, description);
  append_number(block_, std::uint32_t{0});
  end_block(block_);
  output_.write(block_);
  ++interfaces_;
}

void PcapngSink::on_comment(std::string_view line, Time time) { write_line(line, time); }

void PcapngSink::on_path(const RecordedPath& path, Time time) {
  text_.clear();
  write_path(text_, path);
  text_.pop_back();
  write_line(text_, time);
  Path& known = paths_[path.number];
  if (known.url != path.url) known = {path.url, 0, 0, 0};
}

void PcapngSink::on_record(const Record& record) {
  if (record.kind == RecordKind::event) {
    text_.clear();
    write_record(text_, record);
    text_.pop_back();
    return write_line(text_, record.time);
  }
  begin();
  const Path& path = path_of(record.path);
  const std::string_view bytes = record.bytes.substr(0, max_record_bytes);
  if (record.kind == RecordKind::from_board) {
    write_head(head_, path.address, path.port, made_up_host, host_port, bytes.size());
    write_packet(path.interface, record.time, head_, bytes, inbound);
  } else {
    write_head(head_, made_up_host, host_port, path.address, path.port, bytes.size());
    write_packet(path.interface, record.time, head_, bytes, outbound);
  }
}

PcapngSink::Path& PcapngSink::path_of(std::uint16_t number) {
  Path& path = paths_[number];
  if (path.interface != 0) return path;
  path.interface = interfaces_;
  path.address = made_up_board + number;
  path.port = board_port;
  try {
    const Url url = Url::parse(path.url);
    in_addr address{};
    if (url.scheme() == "udp" && ::inet_pton(AF_INET, url.host().c_str(), &address) == 1 &&
        ntohl(address.s_addr) != made_up_host) {
      path.address = ntohl(address.s_addr);
      path.port = url.port().value_or(board_port);
    }
  } catch (const Error&) {  // unknown or not a valid URL: invent the address
  }
  add_interface(link_ipv4,
                path.url.size() <= max_interface_text ? printable(path.url) : std::string(),
                fmt::format("{}{}", path_interface, number));
  return path;
}

void PcapngSink::write_line(std::string_view line, Time time) {
  begin();
  write_packet(0, time, shown_as_syslog, line, 0);
}

void PcapngSink::write_packet(std::uint32_t interface, Time time, std::string_view head,
                              std::string_view payload, std::uint32_t flags) {
  const auto us = static_cast<std::uint64_t>(time.count());
  const auto size = static_cast<std::uint32_t>(head.size() + payload.size());
  begin_block(block_, pcapng_packet);
  append_number(block_, interface);
  append_number(block_, static_cast<std::uint32_t>(us >> 32));
  append_number(block_, static_cast<std::uint32_t>(us));
  append_number(block_, size);
  append_number(block_, size);
  block_ += head;
  block_ += payload;
  pad(block_);
  if (flags != 0) {
    std::string value;
    append_number(value, flags);
    append_option(block_, epb_flags, value);
    append_number(block_, std::uint32_t{0});
  }
  end_block(block_);
  output_.write(block_);
}

}  // namespace r4::tool
