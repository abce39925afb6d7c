// SPDX-License-Identifier: GPL-3.0-or-later
// Metrics as text, by prometheus-cpp: of a build with -DR4_METRICS=ON.
#include <prometheus/metric_family.h>
#include <prometheus/text_serializer.h>

#include <string>
#include <utility>
#include <vector>

#include "board_metrics.hpp"

namespace r4::tool {

bool has_metrics() { return true; }

void require_metrics() {}

std::string MetricFamilies::text() const {
  std::vector<prometheus::MetricFamily> written;
  for (const MetricFamily& family : families_) {
    const bool gauge = family.kind == MetricKind::gauge;
    written.push_back({family.name,
                       family.help,
                       gauge ? prometheus::MetricType::Gauge : prometheus::MetricType::Counter,
                       {}});
    for (const MetricFamily::Metric& each : family.metrics) {
      prometheus::ClientMetric metric;
      for (const auto& [name, value] : each.labels) metric.label.push_back({name, value});
      (gauge ? metric.gauge.value : metric.counter.value) = each.value;
      written.back().metric.push_back(std::move(metric));
    }
  }
  return prometheus::TextSerializer().Serialize(written);
}

}  // namespace r4::tool
