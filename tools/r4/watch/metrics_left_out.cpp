// SPDX-License-Identifier: GPL-3.0-or-later
// In the place of metrics: of a build with -DR4_METRICS=OFF.
#include <string>

#include "board_metrics.hpp"
#include "r4link/error.hpp"

namespace r4::tool {

bool has_metrics() { return false; }

void require_metrics() {
  throw Error(ErrorKind::unsupported, "r4 metrics",
              "this build of r4 does not have it (R4_METRICS=OFF)",
              "install prometheus-cpp (Debian and Ubuntu: prometheus-cpp-dev), and build r4 with "
              "cmake -DR4_METRICS=ON");
}

std::string MetricFamilies::text() const {
  require_metrics();
  return {};
}

}  // namespace r4::tool
