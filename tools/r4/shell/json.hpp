// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "output.hpp"
#include "r4link/carrier.hpp"
#include "r4link/datagram.hpp"
#include "r4link/error.hpp"

namespace r4::tool {

using Json = nlohmann::ordered_json;

// One value of a field: a number if JSON's grammar allows it ("24.28", "-100"), else a string.
Json value_json(Text value);

Json field_json(const Field& field);

// All fields except PNum and T, by name, in order. A name that occurs twice has an array of values.
Json fields_json(const Datagram& datagram);

// {"error":"crc","position":…,"expected":"0x…","found":"0x…"}; the last two for crc only.
Json bad_datagram_json(const ReadResult& result);

// Adds `ok`; `type`, `pnum`, `t` and `fields`, or `error` and its position; `text`. True if valid.
bool add_datagram_json(Json& object, std::string_view bytes);

// {"type":"error","kind":…,"thing":…,"reason":…,"fix":…}; for a command also "outcome" and "code".
Json problem_json(const Problem& problem);

// {"wrong_sequence":…,"timed_out":…,"overflow":…,"interrupted":…,"cancelled":…,"unexpected":…,
//  "malformed":…,"packed":…,"bad_form":…,"dropped_frames":…}; null if the transport has no frames.
Json transfers_json(const CarrierCounters& counters);

// {"received":…,"sent":…,"dropped":…,"errors":…,"oversize":…,"foreign":…,"downs":…} in datagrams,
// with "transfers" if the transport uses frames.
Json counters_json(const CarrierCounters& counters);

// Printable ASCII stays, except the backslash. All other bytes, and the backslash, become \xNN.
std::string escaped(std::string_view bytes);

// Bytes that are not UTF-8 are replaced. line_of() is ASCII.
std::string text_of(const Json& value);
std::string line_of(const Json& object);

void print_line(const Json& object);

}  // namespace r4::tool
