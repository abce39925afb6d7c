// SPDX-License-Identifier: GPL-3.0-or-later
// The chip's generator of true random numbers.
#pragma once

#include <cstddef>
#include <cstdint>

namespace r4 {
namespace giga {

// Fills `out`. False: the generator does not work, and what is in `out` is not random.
bool true_random(std::uint8_t* out, std::size_t size);

}  // namespace giga
}  // namespace r4
