// SPDX-License-Identifier: GPL-3.0-or-later
// The words of signals in a wiring file.
#pragma once

#include <string>
#include <string_view>

namespace r4 {

struct SignalWords {
  std::string_view name;
  std::string_view part;    // may be empty
  std::string_view option;  // empty: no option
};
// `signal`: an index in Wiring.
const SignalWords& words_of(int signal);

// A word of a file for an error: printable(), at most 40 bytes.
std::string shown_word(std::string_view word);

}  // namespace r4
