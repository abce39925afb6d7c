// SPDX-License-Identifier: GPL-3.0-or-later
// The local sockets of programs that share a transport. Their names are kept by the kernel
// (abstract, unix(7)): a name is free as soon as its program has ended. Like UDP ports and CAN
// interfaces, the names belong to a network namespace.
//
// A transport has two names. The program that controls the board holds one. While no program
// controls it, a program that watches holds the other. A name contains the user's number, or the
// name of the group that shares the transport. Any user can take a name, so both ends ask the
// kernel who the other end is. No call here blocks.
#pragma once

#include <sys/types.h>

#include <cerrno>
#include <optional>
#include <string>
#include <string_view>

#include "../file_descriptor.hpp"
#include "../share_name.hpp"
#include "r4link/options.hpp"
#include "share_message.hpp"

namespace r4 {

// Takes the name of the holder with that role. None, with errno: EADDRINUSE if another program has
// it.
FileDescriptor take_share_name(const ShareName& name, BoardRole role);
// A connection to the program that has that name. None, with errno: ECONNREFUSED if no program has
// it; would_block() if many programs wait there already.
FileDescriptor connect_to_holder(const ShareName& name, BoardRole role);
// The connection of the next program that waits at a holder. None, with errno.
FileDescriptor accept_sharer(int holder);

inline bool would_block(int error) { return error == EAGAIN || error == EWOULDBLOCK; }

// True if the program at the other end is of the same user or, if the transport is shared with a
// group, of one of its members or of root.
bool is_one_of_us(int connection, const ShareName& name);
// The process at the other end.
pid_t process_of(int connection);
// "r4"; "another program" if it cannot be read.
std::string program_of(pid_t process);
// True if the process is stopped, by Ctrl-Z for example.
bool is_stopped(pid_t process);

// 0, or errno.
int send_message(int connection, ShareMessage::Kind kind, std::string_view text);
// The packet's size, which is larger than `size` if it was cut; 0 at the end of the connection; -1
// with errno.
ssize_t receive_packet(int connection, char* out, std::size_t size);

}  // namespace r4
