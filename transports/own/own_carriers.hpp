// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <asio/io_context.hpp>
#include <memory>

#include "r4link/transports/own_transport.hpp"

namespace r4 {

std::unique_ptr<Carrier> make_own_carrier(Loop& loop, std::shared_ptr<OwnTransport> transport);
std::unique_ptr<Carrier> make_own_can_carrier(asio::io_context& io, std::shared_ptr<OwnCanBus> bus,
                                              const OwnCanNode& node, Role role);

}  // namespace r4
