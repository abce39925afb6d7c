// SPDX-License-Identifier: GPL-3.0-or-later
// Two carriers joined inside one process, on one io_context. A datagram arrives on the next turn of
// the event loop, in order, stops first. Each end is up while both are open. If 128 datagrams or 32
// states wait for the receiver, the rules of Priority apply.
#pragma once

#include <asio/io_context.hpp>
#include <memory>
#include <string>
#include <utility>

#include "r4link/carrier.hpp"

namespace r4 {

std::pair<std::unique_ptr<Carrier>, std::unique_ptr<Carrier>> make_memory_pair(
    asio::io_context& io, std::string name = "memory:");

}  // namespace r4
