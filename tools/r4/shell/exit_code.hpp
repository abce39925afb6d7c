// SPDX-License-Identifier: GPL-3.0-or-later
// How `r4` shows an error's kind: its exit code, and its name in JSON (docs/reference/commands.md).
#pragma once

#include <cstddef>
#include <iterator>

#include "r4link/error.hpp"

namespace r4::tool {

struct ErrorKindRow {
  ErrorKind kind;
  int exit_code;
  const char* name;
};

inline constexpr ErrorKindRow error_kinds[] = {
    {ErrorKind::data, 1, "data"},
    {ErrorKind::usage, 2, "usage"},
    {ErrorKind::refused, 3, "refused"},
    {ErrorKind::open, 4, "open"},
    {ErrorKind::permission, 5, "permission"},
    {ErrorKind::unsupported, 6, "unsupported"},
};

// The program must not compile if a kind lacks its row.
static_assert(error_kinds[std::size(error_kinds) - 1].kind == ErrorKind::unsupported &&
                  std::size(error_kinds) == static_cast<std::size_t>(ErrorKind::unsupported),
              "each kind has a row");

constexpr const ErrorKindRow& row_of(ErrorKind kind) {
  for (const ErrorKindRow& row : error_kinds) {
    if (row.kind == kind) return row;
  }
  return error_kinds[0];
}

constexpr int exit_code(ErrorKind kind) { return row_of(kind).exit_code; }

}  // namespace r4::tool
