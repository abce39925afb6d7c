// SPDX-License-Identifier: GPL-3.0-or-later
// A wiring in words, and as a text file (docs/reference/wiring.md):
//     r4-wiring 1
//     stepper 1 step = D2                  # a signal and its place
//     stepper 1 direction = D34 inverted   # with its option
//     encoder 4 index = none               # not connected
//
// A file has a line for each signal, in any order. Errors are Error{data} with the line, the
// signal, the reason and the fix. Words from a file are shown by printable() and shortened.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "../config.hpp"
#include "../error.hpp"
#include "wiring.hpp"

namespace r4 {

// `signal`: an index in Wiring, 0 to signal_count - 1. Such as "stepper 1 direction", "handle".
R4LINK_API std::string signal_name(int signal);
// The inverse of signal_name(). Throws Error{data}.
R4LINK_API int signal_named(std::string_view name);

// "D34 inverted", "A0", "osmc.1", "GPB7", "VOUTA", "0x40", "SDA1/SCL1", "none".
R4LINK_API std::string place_name(int signal, Place place);
// The inverse of place_name(). Throws Error{data} if the signal cannot have such a place.
R4LINK_API Place place_named(int signal, std::string_view name);

// The fault of a wiring in words. `found` is the result of check(), and not WiringFault::none.
R4LINK_API Problem problem_of(const Wiring& wiring, const WiringCheck& found);

// A whole file, with comments.
R4LINK_API std::string write_wiring(const Wiring& wiring);

constexpr std::size_t max_wiring_text = 64 * 1024;  // bytes
// Reads and checks the text of a file. `name`: the file's name, for errors.
R4LINK_API Wiring read_wiring(std::string_view text, const std::string& name = "wiring");
// Also throws Error{open} or Error{permission}.
R4LINK_API Wiring load_wiring(const std::string& path);

}  // namespace r4
