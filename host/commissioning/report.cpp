// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/commissioning/report.hpp"

#include <array>

#include "r4link/commissioning/person.hpp"

namespace r4::commissioning {

const char* to_text(Status status) {
  constexpr std::array texts = {"not done", "passed", "found", "skipped", "unsupported"};
  static_assert(texts.size() == static_cast<std::size_t>(Status::unsupported) + 1);
  const auto at = static_cast<std::size_t>(status);
  return at < texts.size() ? texts[at] : "unknown";
}

const char* to_text(Topic topic) {
  constexpr std::array texts = {"supply off",
                                "wheels off ground",
                                "clear",
                                "restart",
                                "address seen",
                                "meter",
                                "handle held",
                                "handle released",
                                "wheel turned",
                                "hand before sensor",
                                "hand away",
                                "baud",
                                "supply with relay open",
                                "supply with relay closed",
                                "which",
                                "forward",
                                "two pwm inputs",
                                "servo supply",
                                "give wiring",
                                "give settings"};
  static_assert(texts.size() == static_cast<std::size_t>(Topic::give_settings) + 1);
  const auto at = static_cast<std::size_t>(topic);
  return at < texts.size() ? texts[at] : "unknown";
}

std::vector<Found> Report::found() const {
  std::vector<Found> all;
  for (const CheckResult& each : checks) {
    all.insert(all.end(), each.found.begin(), each.found.end());
  }
  return all;
}

}  // namespace r4::commissioning
