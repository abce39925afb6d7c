// SPDX-License-Identifier: GPL-3.0-or-later
// The local sockets of programs that share a wire: one a wire, in the namespace of names that the kernel
// keeps (abstract, unix(7)), where a name is free as soon as its program is gone. Like UDP ports and CAN
// interfaces these belong to a network namespace.
//
// The name holds the user's number, but anyone may take a name. So both ends look who the other is: the same user,
// or root that asks.
#pragma once

#include <sys/types.h>

#include <string>
#include <string_view>

#include "../file_descriptor.hpp"
#include "share_message.hpp"

namespace r4 {

// Who is at the other end: told by the kernel, when the connection was made.
struct ShareCredentials {
  pid_t pid = 0;
  uid_t uid = 0;
};

// Takes the place of the holder of that wire. None, if another program has it.
FileDescriptor hold_wire(const std::string& wire);

// A connection to its holder, or to a stranger who has taken that name: credentials_of() tells. None, if there
// is none.
FileDescriptor reach_holder(const std::string& wire);

// The next one who has come to a holder, or none: strangers are turned away.
FileDescriptor accept_sharer(int holder);

ShareCredentials credentials_of(int connection);

// None of these blocks. send_message(): 0, or errno. receive_packet(): the packet's size, which may be more
// than `size` and was cut then; 0 at the end of the connection; -1 with errno.
int send_message(int connection, ShareMessage::Kind kind, std::string_view text);
ssize_t receive_packet(int connection, char* out, std::size_t size);

}  // namespace r4
