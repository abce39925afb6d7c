// SPDX-License-Identifier: GPL-3.0-or-later
#include "true_random.hpp"

#include "chip.hpp"

namespace r4 {
namespace giga {

bool true_random(std::uint8_t* out, std::size_t size) {
  trng_t generator;
  trng_init(&generator);
  std::size_t made = 0;
  while (made < size) {
    std::size_t more = 0;
    if (trng_get_bytes(&generator, out + made, size - made, &more) != 0 || more == 0) break;
    made += more;
  }
  trng_free(&generator);
  return made == size;
}

}  // namespace giga
}  // namespace r4
