// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

namespace r4 {
namespace giga {

// Fills `out` with true random bytes. False: the generator does not work, and `out` is not random.
bool true_random(std::uint8_t* out, std::size_t size);

}  // namespace giga
}  // namespace r4
