// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "../shell/json.hpp"
#include "r4link/commissioning/report.hpp"

namespace r4::tool {

std::string result_text(const commissioning::CheckResult& result);

// {"type":"check","id":…,"status":…,"note":…,"measured":[{"what":…,"value":…,"unit":…},…],
//  "found":[{"finding":…,"thing":…,"detail":…,"wrong":…,"fix":…},…]}
Json result_json(const commissioning::CheckResult& result);

}  // namespace r4::tool
