// SPDX-License-Identifier: GPL-3.0-or-later
// The board's end of a pseudo-terminal: `pty:` or `pty:PATH`.
//
// A host opens the other end as serial:///dev/pts/N; name() is "pty:/dev/pts/N". With a PATH, that
// is a link to it, made in open() and removed in close(); it replaces a link, and nothing else.
//
// It is up while a host has the other end open. Without a host nothing is written, so the next host
// finds nothing stale. If a stalled host has left something unread for 30 ms, that is thrown away
// before a new state is written. So the first state that it reads when it wakes is younger than
// 50 ms.
#pragma once

#include <asio/io_context.hpp>
#include <memory>

#include "../share_name.hpp"
#include "r4link/carrier.hpp"
#include "r4link/discovery/url.hpp"

namespace r4 {

// Throws Error{usage} for a host, which opens the other end, and for a URL that pty does not take.
std::unique_ptr<Carrier> make_pty_carrier(asio::io_context& io, const Url& url, Role role,
                                          const Claim& = {});

}  // namespace r4
