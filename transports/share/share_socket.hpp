// SPDX-License-Identifier: GPL-3.0-or-later
// The local sockets of programs that share a wire: one a wire, in the namespace of names that the kernel
// keeps (abstract, unix(7)), where a name is free as soon as its program is gone. Like UDP ports and CAN
// interfaces these belong to a network namespace.
//
// The name holds the user's number, or the group's name where it is shared with one. But anyone may take a name: so
// both ends look who the other is, as the kernel tells it.
#pragma once

#include <sys/types.h>

#include <cerrno>
#include <chrono>
#include <string_view>

#include "../file_descriptor.hpp"
#include "../shared_wire.hpp"
#include "share_message.hpp"

namespace r4 {

// Who is at the other end: told by the kernel, when the connection was made.
struct ShareCredentials {
  pid_t pid = 0;
  uid_t uid = 0;
  gid_t gid = 0;
};

// Where a holder hangs, those that share the wire meet at another place.
constexpr int share_places = 4;
SharedWire at_place(const SharedWire& wire, int place);

// Takes the place of the holder of that wire. None, if another program has it.
FileDescriptor hold_wire(const SharedWire& wire);

// A connection to its holder, or to a stranger who has taken that name: is_one_of_us() tells. None, if there is
// none. If many programs wait for the holder already, this waits for a free place, for `within` at most: a holder
// under attack lets them in a few at a time, and one that hangs never does.
struct ReachedHolder {
  FileDescriptor connection;
  bool hangs = false;
};
ReachedHolder reach_holder(const SharedWire& wire, std::chrono::milliseconds within = {});

// The connection of the next program that waits at a holder, whoever it is; none, with errno.
FileDescriptor accept_sharer(int holder);

// Of a call on such a socket that does not wait.
inline bool would_block(int error) { return error == EAGAIN || error == EWOULDBLOCK; }

ShareCredentials credentials_of(int connection);
// True if the other end is of the same user or, if the wire is shared with a group, of one of its members or root.
bool is_one_of_us(int connection, const SharedWire& wire);
// True if a holder lets the other end say why it has come: one of us, or root.
bool may_come(int connection, const SharedWire& wire);

// None of these blocks. send_message(): 0, or errno. receive_packet(): the packet's size, which may be more
// than `size` and was cut then; 0 at the end of the connection; -1 with errno.
int send_message(int connection, ShareMessage::Kind kind, std::string_view text);
ssize_t receive_packet(int connection, char* out, std::size_t size);

}  // namespace r4
