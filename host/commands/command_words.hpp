// SPDX-License-Identifier: GPL-3.0-or-later
// Words for commands and settings. The portable core (r4link/tables/) has no words.
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
  // describe() replaces the names in braces.
  std::string_view sentence;
  // For a value of 0 or an omitted optional value. Empty: `sentence` is used.
  std::string_view empty_sentence = {};
};
const KindWords& words_of(CommandKind kind);

// "50-1000 ms, below the timeout".
std::string values_of(Setting setting);

}  // namespace r4
