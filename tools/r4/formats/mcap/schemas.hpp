// SPDX-License-Identifier: GPL-3.0-or-later
// JSON schemas (json-schema.org) of messages in an MCAP file and from r4 web to Foxglove.
#pragma once

#include <string>

namespace r4::tool::mcap {

std::string record_schema_text();
std::string line_schema_text();
std::string link_schema_text();
std::string event_schema_text();

}  // namespace r4::tool::mcap
