// SPDX-License-Identifier: GPL-3.0-or-later
// The board's end of a pseudo-terminal: `pty:` or `pty:PATH`. A host opens the other end as
// serial:///dev/pts/N. PATH is a link to the other end. open() makes the link, and close() removes
// it. open() replaces a link, but no other file. name() is "pty:PATH" or "pty:/dev/pts/N".
// The carrier is up while a host has the other end open. Without a host nothing is written, so the
// next host reads nothing stale. Bytes that a stalled host leaves unread for 30 ms are discarded
// before a new state is written. So the first state that the host then reads is younger than 50 ms.
#pragma once

#include <asio/io_context.hpp>
#include <memory>

#include "../share_name.hpp"
#include "r4link/carrier.hpp"
#include "r4link/discovery/url.hpp"

namespace r4 {

// Throws Error{usage} for a host (which opens the other end), and for a URL that pty refuses.
std::unique_ptr<Carrier> make_pty_carrier(asio::io_context& io, const Url& url, Role role,
                                          const Claim& = {});

}  // namespace r4
