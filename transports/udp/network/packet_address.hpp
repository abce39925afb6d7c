// SPDX-License-Identifier: GPL-3.0-or-later
// This computer's address to which a packet was sent, and from which its answer leaves. A host
// accepts answers from that address only. A socket bound to all addresses would answer from the
// route's address.
#pragma once

#include <asio/ip/address.hpp>
#include <asio/ip/udp.hpp>
#include <cstddef>
#include <optional>
#include <string_view>

namespace r4 {

// Makes the kernel report the destination address of each packet.
void note_addresses(int socket, const asio::ip::udp& protocol);

// Takes the next packet. Returns its size, which may exceed `room`; none: no packet. Sets `at` to
// its destination; unspecified if unknown or not of this computer (multicast).
std::optional<std::size_t> receive_packet(int socket, char* out, std::size_t room,
                                          asio::ip::udp::endpoint& from, asio::ip::address& at);

// Sends from `from`, or from any address if `from` is unspecified or lost. 0 if sent, else errno.
int send_packet(int socket, std::string_view bytes, const asio::ip::udp::endpoint& to,
                const asio::ip::address& from);

}  // namespace r4
