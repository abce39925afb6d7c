// SPDX-License-Identifier: GPL-3.0-or-later
#include "finding.hpp"

#include <algorithm>

#include "../shell/exit_code.hpp"

namespace r4::tool {

const char* to_text(Severity severity) {
  switch (severity) {
    case Severity::ok:
      return "ok";
    case Severity::note:
      return "note";
    case Severity::warning:
      return "warning";
    case Severity::error:
      return "error";
  }
  return "unknown";
}

int exit_code(const Findings& findings) {
  const auto is = [](Severity severity) {
    return [severity](const Finding& each) { return each.severity == severity; };
  };
  const auto error = std::find_if(findings.begin(), findings.end(), is(Severity::error));
  if (error != findings.end()) return exit_code(error->kind);
  return std::any_of(findings.begin(), findings.end(), is(Severity::warning)) ? 1 : 0;
}

}  // namespace r4::tool
