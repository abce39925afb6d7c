// SPDX-License-Identifier: GPL-3.0-or-later
// Opens a tty for lines of datagrams: 8N1, raw, no flow control, locked.
#pragma once

#include <asio/io_context.hpp>
#include <string>

#include "../file_descriptor.hpp"
#include "port_lock.hpp"

namespace r4 {

// libserialport opens and sets up a device with an entry in sysfs, Asio a device without one (a
// pty). Low latency is set if the driver has it. Input that arrived before is thrown away. The
// result does not block: EAGAIN means no data, 0 bytes a hang-up.
//
// A second opening of the same device fails: `lock` keeps other r4 programs out, TIOCEXCL all
// programs. TIOCEXCL is not set for a pty, because the simulated board could not see what its host
// has not read. Nor is it set if the port may be taken from this program or was taken from another
// program, because it lasts longer than the program that has set it.
//
// Throws Error: open (missing, in use, not a tty), permission, usage (a rate that the device
// refuses).
FileDescriptor open_serial_device(asio::io_context& io, const std::string& path, unsigned baud,
                                  const DeviceClaim& claim, PortLock& lock);

// The file to which symbolic links such as /dev/serial/by-id/… lead; `path` itself if there is no
// such file.
std::string resolve_links(const std::string& path);

}  // namespace r4
