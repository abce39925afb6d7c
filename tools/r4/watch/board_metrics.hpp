// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "../boards/board_set.hpp"

namespace r4::tool {

using MetricLabels = std::vector<std::pair<std::string, std::string>>;

// Metrics in the text format of Prometheus (exposition format 0.0.4).
class MetricFamilies {
 public:
  template <class Integer>
  void count(const char* name, const char* help, const MetricLabels& labels, Integer value) {
    counter(name, help, labels, static_cast<double>(value));
  }
  void gauge(const char* name, const char* help, const MetricLabels& labels, double value) {
    add(name, help, "gauge", labels, value);
  }
  void counter(const char* name, const char* help, const MetricLabels& labels, double value) {
    add(name, help, "counter", labels, value);
  }
  std::string text() const;

 private:
  void add(const char* name, const char* help, const char* type, const MetricLabels& labels,
           double value);

  std::map<std::string, std::string> families_;
};

void describe(const SetBoard& each, MetricFamilies& out);

}  // namespace r4::tool
