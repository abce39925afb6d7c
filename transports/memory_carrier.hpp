// SPDX-License-Identifier: GPL-3.0-or-later
// Two carriers joined inside one process: the other end receives a datagram on the next turn of the
// event loop, in order, stop first. Each end is up while both are open. Bounded: when the receiver
// lags by 128 datagrams, or 32 states, the rules of Priority apply. Both ends live on the same
// io_context.
#pragma once

#include <asio/io_context.hpp>
#include <memory>
#include <string>
#include <utility>

#include "r4link/carrier.hpp"

namespace r4 {

// `name` is the name() of both ends.
std::pair<std::unique_ptr<Carrier>, std::unique_ptr<Carrier>> make_memory_pair(
    asio::io_context& io, std::string name = "memory:");

}  // namespace r4
