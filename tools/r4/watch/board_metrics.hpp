// SPDX-License-Identifier: GPL-3.0-or-later
// What Prometheus is told of boards, by r4 metrics and r4 web.
#pragma once

#include <prometheus/metric_family.h>

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "r4link/async_board.hpp"

namespace r4::tool {

using MetricLabels = std::vector<prometheus::ClientMetric::Label>;

// The families of one answer, by name.
class MetricFamilies {
 public:
  template <class Integer>
  void count(const char* name, const char* help, MetricLabels labels, Integer value) {
    counter(name, help, std::move(labels), static_cast<double>(value));
  }
  void gauge(const char* name, const char* help, MetricLabels labels, double value) {
    prometheus::ClientMetric metric;
    metric.label = std::move(labels);
    metric.gauge.value = value;
    add(name, help, prometheus::MetricType::Gauge, std::move(metric));
  }
  void counter(const char* name, const char* help, MetricLabels labels, double value) {
    prometheus::ClientMetric metric;
    metric.label = std::move(labels);
    metric.counter.value = value;
    add(name, help, prometheus::MetricType::Counter, std::move(metric));
  }
  // In the text format of Prometheus.
  std::string text() const;

 private:
  void add(const char* name, const char* help, prometheus::MetricType type,
           prometheus::ClientMetric metric) {
    const auto [known, fresh] = index_.try_emplace(name, families_.size());
    if (fresh) {
      families_.emplace_back();
      families_.back().name = name;
      families_.back().help = help;
      families_.back().type = type;
    }
    families_[known->second].metric.push_back(std::move(metric));
  }

  std::map<std::string, std::size_t> index_;
  std::vector<prometheus::MetricFamily> families_;
};

// A board under the URL that the user gave: the same whenever the program is started.
struct MetricBoard {
  std::string url;
  const AsyncBoard* board;
};

// What is told of one board.
void describe(const MetricBoard& each, MetricFamilies& out);

}  // namespace r4::tool
