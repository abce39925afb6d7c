// SPDX-License-Identifier: GPL-3.0-or-later
// A board's key from a file: one line, `<id>:<64 hexadecimal digits>`, as `r4 key new` makes it.
//
//     r4::BoardOptions options;
//     options.session.key = r4::load_key("/home/me/.r4-key");
//     r4::Board board("udp://192.168.0.125", options);
#pragma once

#include <string>

#include "../protocol/keys/key.hpp"

namespace r4 {

// Throws Error: open if it cannot be read, permission if others than its owner may read or write
// it, data if it holds no key.
Key load_key(const std::string& path);

}  // namespace r4
