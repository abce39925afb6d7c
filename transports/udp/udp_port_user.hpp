// SPDX-License-Identifier: GPL-3.0-or-later
// Who has a UDP port of this machine, as far as the system tells this user (proc(5)).
#pragma once

#include <cstdint>
#include <string>

namespace r4 {

// "r4 (pid 123)"; "another program" where it is another user's.
std::string user_of_udp_port(std::uint16_t port);

}  // namespace r4
