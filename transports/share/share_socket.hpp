// SPDX-License-Identifier: GPL-3.0-or-later
// The local sockets of programs that share a transport. The kernel keeps their abstract names
// (unix(7)), in a network namespace, until the program ends. A transport has two names: for the
// controlling program, and for a watching program that holds the transport while no program
// controls the board. A name contains the user's number or the sharing group's name. Any user can
// take a name, so both ends read the user at the other end from the kernel. No call blocks.
#pragma once

#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <string>
#include <string_view>

#include "../file_descriptor.hpp"
#include "../operation_slot.hpp"
#include "../share_name.hpp"
#include "r4link/options.hpp"
#include "share_message.hpp"

namespace r4 {

// Binds the holder's name for `role`. None, with errno: EADDRINUSE if another program has the name.
FileDescriptor take_share_name(const ShareName& name, BoardRole role);
// Connects to a holder. None, with errno: ECONNREFUSED (the transport has no holder), or
// would_block() (too many programs wait).
FileDescriptor connect_to_holder(const ShareName& name, BoardRole role);
// The next connection that waits at a holder. None, with errno.
FileDescriptor accept_sharer(int holder);

inline bool would_block(int error) { return error == EAGAIN || error == EWOULDBLOCK; }

// True if the other program runs as this program's user. If a group shares the transport, also true
// for members of the group and for root.
bool is_one_of_us(int connection, const ShareName& name);
pid_t process_of(int connection);
// The program's name, as in "r4"; "another program" if it cannot be read.
std::string program_of(pid_t process);
bool is_stopped(pid_t process);

// 0, or errno.
int send_message(int connection, ShareMessage::Kind kind, std::string_view text);

enum class Received { all, more, end };
// Passes up to `most` messages to `on_message`, an invalid message as none. `end`: disconnected.
// `more`: messages may wait, or `on_message` has closed the connection.
template <class OnMessage>
Received receive_messages(LoopDescriptor& connection, int most, OnMessage on_message) {
  std::array<char, ShareMessage::max_size + 1> packet;
  for (int i = 0; i < most && connection.is_open(); ++i) {
    const ssize_t size =
        ::recv(connection.native_handle(), packet.data(), packet.size(), MSG_TRUNC);
    if (size < 0 && would_block(errno)) return Received::all;
    // The other program ended without reading all messages. Its own messages can be read.
    if (size < 0 && errno == ECONNRESET) continue;
    if (size <= 0) return Received::end;
    on_message(read_share_message({packet.data(), static_cast<std::size_t>(size)}));
  }
  return Received::more;
}

}  // namespace r4
