// SPDX-License-Identifier: GPL-3.0-or-later
// Asio's own code, compiled once.
#include <asio/impl/src.hpp>
