// SPDX-License-Identifier: GPL-3.0-or-later
// The address of this computer that a packet was sent to, and from which its answer leaves. A
// socket that is bound to all addresses would answer from the one that the route prefers, and a
// host hears only the address that it asked.
#pragma once

#include <asio/ip/address.hpp>
#include <asio/ip/udp.hpp>
#include <cstddef>
#include <optional>
#include <string_view>

namespace r4 {

// Has the kernel note for each packet of that socket where it was sent to. False: it does not.
bool note_addresses(int socket, const asio::ip::udp& protocol);

// Takes the next packet: its size, which may be more than there is `room` for; none if there is no
// more. `at`: where it was sent to; unspecified if that is not known, or no address of this
// computer's own (multicast).
std::optional<std::size_t> receive_packet(int socket, char* out, std::size_t room,
                                          asio::ip::udp::endpoint& from, asio::ip::address& at);

// Sends a packet from that address of this computer, or by any if it is unspecified, or gone. 0 if
// the system has taken it, else errno.
int send_packet(int socket, std::string_view bytes, const asio::ip::udp::endpoint& to,
                const asio::ip::address& from);

}  // namespace r4
