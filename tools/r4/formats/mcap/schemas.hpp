// SPDX-License-Identifier: GPL-3.0-or-later
// The JSON schemas (json-schema.org) of the messages in an MCAP file, and of those that r4 web sends to Foxglove.
#pragma once

#include <string>

namespace r4::tool::mcap {

// Of a board's records: every state field is named, with its unit.
std::string record_schema_text();
// Of lines of the native format.
std::string line_schema_text();
// Of what r4 web tells Foxglove of a board's link, and of its events.
std::string link_schema_text();
std::string event_schema_text();

}  // namespace r4::tool::mcap
