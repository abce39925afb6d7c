// SPDX-License-Identifier: GPL-3.0-or-later
// Datagrams, problems and bytes as JSON: what `--json` prints.
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

// One value of a field: a number if it is one in JSON's grammar too ("24.28", "-100"), else a
// string.
Json value_json(Text value);

// A field's values: alone, or several as an array.
Json field_json(const Field& field);

// All fields but PNum and T, by name, in their order. A name that stands twice has an array of
// both.
Json fields_json(const Datagram& datagram);

// {"error":"crc","position":…,"expected":"0x…","found":"0x…"}; the last two only for crc.
Json bad_datagram_json(const ReadResult& result);

// Adds to `object` what the bytes of a datagram in its plain form are: `ok`; `type`, `pnum`, `t` and
// `fields`, or `error` and where it is; `text`. True if they are a valid datagram.
bool add_datagram_json(Json& object, std::string_view bytes);

// {"type":"error","kind":…,"thing":…,"reason":…,"fix":…}; of a command also its "outcome" and, where the
// board refused it, the "code".
Json problem_json(const Problem& problem);

// {"wrong_sequence":…,"timed_out":…,"overflow":…,"interrupted":…,"cancelled":…,"unexpected":…,
//  "malformed":…,"packed":…,"bad_form":…,"dropped_frames":…}; null where datagrams do not travel in
//  frames.
Json transfers_json(const CarrierCounters& counters);

// {"received":…,"sent":…,"dropped":…,"errors":…,"oversize":…,"foreign":…,"downs":…}, datagrams; with
// "transfers" where they travel in frames.
Json counters_json(const CarrierCounters& counters);

// Any bytes as printable ASCII: what is not, and the backslash, as \xNN.
std::string escaped(std::string_view bytes);

// The text of a value, and one object as a line of ASCII. Bytes that are not UTF-8, as a command line
// or a board's name may hold, are replaced.
std::string text_of(const Json& value);
std::string line_of(const Json& object);

// An object on a line of its own, to standard output.
void print_line(const Json& object);

}  // namespace r4::tool
