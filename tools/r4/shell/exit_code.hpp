// SPDX-License-Identifier: GPL-3.0-or-later
// How `r4` shows an error's kind: its exit code, and its name in JSON (docs/reference/commands.md).
#pragma once

#include "r4link/error.hpp"

namespace r4::tool {

struct ErrorKindRow {
  int exit_code;
  const char* name;
};

// The compiler warns of a kind without a row.
constexpr ErrorKindRow row_of(ErrorKind kind) {
  switch (kind) {
    case ErrorKind::data:
      return {1, "data"};
    case ErrorKind::usage:
      return {2, "usage"};
    case ErrorKind::refused:
      return {3, "refused"};
    case ErrorKind::open:
      return {4, "open"};
    case ErrorKind::permission:
      return {5, "permission"};
    case ErrorKind::unsupported:
      return {6, "unsupported"};
  }
  return {1, "data"};
}

constexpr int exit_code(ErrorKind kind) { return row_of(kind).exit_code; }

}  // namespace r4::tool
