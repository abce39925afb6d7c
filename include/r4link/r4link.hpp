// SPDX-License-Identifier: GPL-3.0-or-later
// Everything of r4link::r4link. AsyncBoard, for programs with Asio, is in async_board.hpp (r4link::asio).
#pragma once

#include "board.hpp"
#include "carrier.hpp"
#include "command.hpp"
#include "config.hpp"
#include "datagram.hpp"
#include "error.hpp"
#include "fleet.hpp"
#include "key.hpp"
#include "link.hpp"
#include "options.hpp"
#include "recording.hpp"
#include "setpoints.hpp"
#include "simulated_pins.hpp"
#include "simulation.hpp"
#include "state.hpp"
#include "subscription.hpp"
#include "text.hpp"
#include "vocabulary.hpp"
