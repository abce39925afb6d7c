// SPDX-License-Identifier: GPL-3.0-or-later
// A simulated board in the host's process: `sim:[?node=1&seed=N&script=FILE&robot=N]`.
//     node    0-31, default 1: the board's id is sim-<node>
//     seed    makes the board's clock and analog inputs repeatable
//     script  what happens to the board and when (script.hpp)
//     robot   the SimulatedRobot of this program around the board
#pragma once

#include <asio/io_context.hpp>
#include <memory>

#include "r4link/carrier.hpp"
#include "r4link/discovery/url.hpp"

namespace r4::sim {

// open() switches the board on, close() off. Throws Error for a wrong URL or script.
std::unique_ptr<Carrier> make_sim_carrier(asio::io_context& io, const Url& url);

}  // namespace r4::sim
