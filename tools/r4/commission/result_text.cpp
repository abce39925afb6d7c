// SPDX-License-Identifier: GPL-3.0-or-later
#include "result_text.hpp"

#include <fmt/format.h>

namespace r4::tool {

std::string result_text(const commissioning::CheckResult& result) {
  std::string text = fmt::format("  {}{}{}\n", to_text(result.status),
                                 result.note.empty() ? "" : ": ", result.note);
  for (const auto& each : result.measured) {
    text += fmt::format("  {}: {:.4g} {}\n", each.what, each.value, each.unit);
  }
  for (const auto& each : result.found) {
    const auto& words = text_of(each.finding);
    text += fmt::format("  {}: {}{}{}\n    {}\n", each.thing, words.wrong,
                        each.detail.empty() ? "" : " ", each.detail, words.fix);
  }
  return text;
}

Json result_json(const commissioning::CheckResult& result) {
  Json object{
      {"type", "check"},     {"id", result.id},           {"status", to_text(result.status)},
      {"note", result.note}, {"measured", Json::array()}, {"found", Json::array()}};
  for (const auto& each : result.measured) {
    object["measured"].push_back({{"what", each.what}, {"value", each.value}, {"unit", each.unit}});
  }
  for (const auto& each : result.found) {
    const auto& words = text_of(each.finding);
    object["found"].push_back({{"finding", words.name},
                               {"thing", each.thing},
                               {"detail", each.detail},
                               {"wrong", words.wrong},
                               {"fix", words.fix}});
  }
  return object;
}

}  // namespace r4::tool
