// SPDX-License-Identifier: GPL-3.0-or-later
// The transports that a URL can name, as text for a program's --help.
#pragma once

#include <string>
#include <vector>

#include "../config.hpp"

namespace r4 {

struct TransportHelp {
  std::string scheme;   // "udp"
  std::string usage;    // "udp://HOST[:2018][?listen=2390&local=ADDRESS]"
  std::string meaning;  // one line
};

R4LINK_API std::vector<TransportHelp> transports();

}  // namespace r4
