// SPDX-License-Identifier: GPL-3.0-or-later
// What Prometheus is told of boards, by r4 metrics and r4 web.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "../boards/board_set.hpp"

namespace r4::tool {

using MetricLabels = std::vector<std::pair<std::string, std::string>>;

// True if this build can write metrics: CMake's option R4_METRICS.
bool has_metrics();
// Throws Error if it cannot.
void require_metrics();

enum class MetricKind : std::uint8_t { gauge, counter };

struct MetricFamily {
  struct Metric {
    MetricLabels labels;
    double value;
  };
  std::string name;
  std::string help;
  MetricKind kind;
  std::vector<Metric> metrics;
};

// The families of one answer, by name.
class MetricFamilies {
 public:
  template <class Integer>
  void count(const char* name, const char* help, MetricLabels labels, Integer value) {
    counter(name, help, std::move(labels), static_cast<double>(value));
  }
  void gauge(const char* name, const char* help, MetricLabels labels, double value) {
    add(name, help, MetricKind::gauge, {std::move(labels), value});
  }
  void counter(const char* name, const char* help, MetricLabels labels, double value) {
    add(name, help, MetricKind::counter, {std::move(labels), value});
  }
  // In the text format of Prometheus. Throws Error as require_metrics() does.
  std::string text() const;

 private:
  void add(const char* name, const char* help, MetricKind kind, MetricFamily::Metric metric) {
    const auto [known, fresh] = index_.try_emplace(name, families_.size());
    if (fresh) families_.push_back({name, help, kind, {}});
    families_[known->second].metrics.push_back(std::move(metric));
  }

  std::map<std::string, std::size_t> index_;
  std::vector<MetricFamily> families_;
};

// What is told of one board.
void describe(const SetBoard& each, MetricFamilies& out);

}  // namespace r4::tool
