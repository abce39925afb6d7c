// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

extern "C" {
struct trng_t {
  void* handle;
};
void trng_init(trng_t* generator);
void trng_free(trng_t* generator);
int trng_get_bytes(trng_t* generator, std::uint8_t* output, std::size_t length,
                   std::size_t* output_length);
}
