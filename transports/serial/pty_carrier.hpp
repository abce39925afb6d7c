// SPDX-License-Identifier: GPL-3.0-or-later
// The board's end of a pseudo-terminal: `pty:` or `pty:PATH`.
//
// A host opens the other end as serial:///dev/pts/N; name() is "pty:/dev/pts/N". With a PATH, that
// is a link to it, made in open() and removed in close(); it replaces a link, and nothing else.
//
// It is up while a host has the other end open. Nothing is written while none has, so that the next
// host finds nothing stale; and what a stalled host has left unread for 30 ms is thrown away before
// a new state is written, so that a state younger than 50 ms is the first that it reads when it
// wakes.
#pragma once

#include <asio/io_context.hpp>
#include <memory>

#include "../url.hpp"
#include "r4link/carrier.hpp"

namespace r4 {

// Throws Error{usage} for a host, which opens the other end, and for a URL that pty does not take.
std::unique_ptr<Carrier> make_pty_carrier(asio::io_context& io, const Url& url, Role role);

}  // namespace r4
