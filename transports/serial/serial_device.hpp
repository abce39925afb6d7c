// SPDX-License-Identifier: GPL-3.0-or-later
// Opens a tty for lines of datagrams: 8N1, raw, no flow control, locked.
#pragma once

#include <asio/io_context.hpp>
#include <string>

#include "../file_descriptor.hpp"
#include "port_lock.hpp"

namespace r4 {

// libserialport opens a device with an entry in sysfs, Asio any other device (a pty). Low latency
// is set if the driver has it. Earlier input is discarded. EAGAIN means no data, 0 bytes a hang-up.
// A second opening fails: `lock` excludes other r4 programs, TIOCEXCL all programs. TIOCEXCL is not
// set for a pty, because the simulated board could not count its host's unread bytes. TIOCEXCL
// outlasts the program, so it is not set by a program that yields the port or took it.
// Throws Error: open (missing, in use, not a tty), permission, usage (refused rate).
FileDescriptor open_serial_device(asio::io_context& io, const std::string& path, unsigned baud,
                                  const DeviceClaim& claim, PortLock& lock);

// The target of symbolic links such as /dev/serial/by-id/…; `path` itself if there is no target.
std::string resolve_links(const std::string& path);

}  // namespace r4
