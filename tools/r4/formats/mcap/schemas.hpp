// SPDX-License-Identifier: GPL-3.0-or-later
// The JSON schemas of the messages in an MCAP file (json-schema.org).
#pragma once

#include <string>

namespace r4::tool::mcap {

// Of a board's records: every state field is named, with its unit.
std::string record_schema_text();
// Of lines of the native format.
std::string line_schema_text();

}  // namespace r4::tool::mcap
