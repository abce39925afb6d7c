// SPDX-License-Identifier: GPL-3.0-or-later
// The words of commands and settings for people, beside the tables of the portable core (r4link/tables/).
#pragma once

#include <string>
#include <string_view>

#include "r4link/tables/commands.hpp"
#include "r4link/tables/settings.hpp"

namespace r4 {

struct KindWords {
  CommandKind kind;
  std::string_view name;     // "OSMC"
  std::string_view meaning;  // "OSMC motor driver"
  // The command in words, for describe(): what stands in braces is listed there.
  std::string_view sentence;
  // The same for a value of 0, and for an optional value that is left out; empty: `sentence`.
  std::string_view empty_sentence = {};
};
const KindWords& words_of(CommandKind kind);

// What the setting takes: "50-1000 ms, below the timeout".
std::string values_of(Setting setting);

}  // namespace r4
