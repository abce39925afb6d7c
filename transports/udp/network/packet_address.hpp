// SPDX-License-Identifier: GPL-3.0-or-later
// The address of this computer to which a packet was sent, and from which its answer leaves. A
// socket that is bound to all addresses would answer from the address that the route prefers, but a
// host hears only the address that it asked.
#pragma once

#include <asio/ip/address.hpp>
#include <asio/ip/udp.hpp>
#include <cstddef>
#include <optional>
#include <string_view>

namespace r4 {

// Lets the kernel report the destination address of each packet of that socket. False if it does
// not.
bool note_addresses(int socket, const asio::ip::udp& protocol);

// Takes the next packet. Returns its size, which may be larger than `room`; none if there is no
// packet. Sets `at` to the address to which it was sent; unspecified if that is not known, or not
// an address of this computer (multicast).
std::optional<std::size_t> receive_packet(int socket, char* out, std::size_t room,
                                          asio::ip::udp::endpoint& from, asio::ip::address& at);

// Sends a packet from that address of this computer; from any address if it is unspecified or gone.
// 0 if the system has taken it, else errno.
int send_packet(int socket, std::string_view bytes, const asio::ip::udp::endpoint& to,
                const asio::ip::address& from);

}  // namespace r4
