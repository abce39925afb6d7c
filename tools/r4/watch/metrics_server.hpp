// SPDX-License-Identifier: GPL-3.0-or-later
// What r4 metrics does: boards and their links for Prometheus. A part of r4-services.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "../shell/options.hpp"

namespace r4::tool {

struct MetricsOptions {
  std::vector<std::string> urls;
  std::string listen = "127.0.0.1:9618";
  std::optional<Milliseconds> duration;
  std::string key;
  bool json = false;
};

// Returns the exit code once it is ended by a signal or by `duration`.
int serve_metrics(const MetricsOptions& options);

}  // namespace r4::tool
