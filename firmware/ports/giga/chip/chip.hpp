// SPDX-License-Identifier: GPL-3.0-or-later
// The Giga's core: Mbed OS, and the STM32H747's registers (CMSIS). Only the Giga port includes it,
// after the standard headers, because it defines macros with common names.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <type_traits>

// clang-format off
#include <Arduino.h>
#include <mbed.h>
#include <hal/trng_api.h>
#include <hal/us_ticker_api.h>
// clang-format on

#undef abs
#undef bit
#undef max
#undef min
#undef round
#undef word
