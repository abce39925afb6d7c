// SPDX-License-Identifier: GPL-3.0-or-later
// Constants of pcapng and packets (draft-ietf-opsawg-pcapng; www.tcpdump.org/linktypes.html).
#pragma once

#include <cstddef>
#include <cstdint>

namespace r4::tool {

// The boards' UDP port in the paper.
constexpr std::uint16_t board_port = 2018;

constexpr std::uint32_t pcapng_section = 0x0A0D0D0A;
constexpr std::uint32_t pcapng_magic = 0x1A2B3C4D;
constexpr std::uint32_t pcapng_interface = 1;
constexpr std::uint32_t pcapng_old_packet = 2;  // obsolete, but some programs write it
constexpr std::uint32_t pcapng_simple_packet = 3;
constexpr std::uint32_t pcapng_packet = 6;
constexpr std::uint16_t pcapng_if_name = 2;
constexpr std::uint16_t pcapng_if_description = 3;
constexpr std::uint16_t pcapng_if_tsresol = 9;
constexpr std::uint16_t pcapng_if_tsoffset = 14;

// Longest interface name written and read, in bytes.
constexpr std::size_t max_interface_text = 1000;

// Longest block and packet read, in bytes.
constexpr std::uint32_t max_block = 1 << 20;

constexpr std::uint8_t udp_protocol = 17;
constexpr std::size_t udp_header = 8;

constexpr std::uint16_t link_null = 0;
constexpr std::uint16_t link_ethernet = 1;
constexpr std::uint16_t link_raw_bsd = 12;      // BSD's DLT_RAW
constexpr std::uint16_t link_raw_openbsd = 14;  // OpenBSD's DLT_RAW
constexpr std::uint16_t link_raw = 101;
constexpr std::uint16_t link_loop = 108;
constexpr std::uint16_t link_linux_sll = 113;
constexpr std::uint16_t link_socketcan = 227;
constexpr std::uint16_t link_ipv4 = 228;
constexpr std::uint16_t link_ipv6 = 229;
constexpr std::uint16_t link_upper_pdu = 252;
constexpr std::uint16_t link_linux_sll2 = 276;

}  // namespace r4::tool
