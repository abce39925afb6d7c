// SPDX-License-Identifier: GPL-3.0-or-later
// The host's way to a simulated board in its own process: `sim:[?node=1&seed=N&script=FILE&robot=N]`.
//
//     node    0-31, default 1: the board's id is sim-<node>
//     seed    makes the board's clock and analog inputs the same each time
//     script  what happens to the board and when (script.hpp)
//     robot   the world around it belongs to that SimulatedRobot of this program
#pragma once

#include <asio/io_context.hpp>
#include <memory>

#include "r4link/carrier.hpp"
#include "r4link/discovery/url.hpp"

namespace r4::sim {

// The carrier's board lives on `io` too: open() switches it on, close() off. Throws Error for a URL
// or a script that is wrong.
std::unique_ptr<Carrier> make_sim_carrier(asio::io_context& io, const Url& url);

}  // namespace r4::sim
