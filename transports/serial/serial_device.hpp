// SPDX-License-Identifier: GPL-3.0-or-later
// Opens a tty for lines of datagrams: 8N1, raw, no flow control, for us alone.
#pragma once

#include <asio/io_context.hpp>
#include <string>

#include "../file_descriptor.hpp"
#include "port_lock.hpp"

namespace r4 {

// A device with an entry in sysfs is opened and set up by libserialport, one without (a pty) by
// Asio. Low latency is asked for where the driver has it. What had arrived before is thrown away.
// The result does not block; no data is EAGAIN, 0 bytes is a hang-up.
//
// A second opening of the same device fails: `lock` keeps other r4 programs out, TIOCEXCL everybody. That is not for a
// pty, where it would keep the simulated board from seeing what its host has not read; nor where the port may be
// taken from this program or was taken from another, for it would outlast whoever has set it.
//
// Throws Error: open (missing, in use, no tty), permission, usage (a rate that the device refuses).
FileDescriptor open_serial_device(asio::io_context& io, const std::string& path, unsigned baud,
                                  const DeviceClaim& claim, PortLock& lock);

// The file that symbolic links such as /dev/serial/by-id/… lead to; `path` itself if it leads
// nowhere.
std::string resolve_links(const std::string& path);

}  // namespace r4
