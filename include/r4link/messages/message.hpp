// SPDX-License-Identifier: GPL-3.0-or-later
// The kind of a datagram, and the content of refusals and identifications. Portable.
//
//     r4::Datagram datagram;
//     if (r4::read_datagram(bytes, datagram) &&
//         r4::kind_of(datagram) == r4::MessageKind::state) …   // read_state() of state.hpp
#pragma once

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../datagram.hpp"
#include "../text.hpp"
#include "../vocabulary.hpp"

namespace r4 {

enum class MessageKind : std::uint8_t {
  board_heartbeat,  // H:R4-ROS2
  host_heartbeat,   // H:ROS2-R4
  command,          // the letter of a command, or a group
  nack,             // N:<PNum>,<code>
  identity,         // I:R4,<firmware>,<board id>,<capabilities>;NAME:…;BUSY:…;ASKED:…
  state,            // any other
};

// "heartbeat" (both sides'), "command", "nack", "identity", "state": the `type` of `r4 decode`.
R4LINK_API const char* to_text(MessageKind kind);

R4LINK_API MessageKind kind_of(const Datagram& datagram);

// False if the datagram's N field is not of that form; `out` is only written on success.
R4LINK_API bool read_nack(const Datagram& datagram, Nack& out);

// A board's identity; views of the datagram. `NAME` and `BUSY` are optional fields.
struct Identity {
  Text firmware;       // "0.1.0"
  Text board_id;       // serial number, unique; is_board_id()
  Text capabilities;   // words joined by '+': "udp+serial+leave"
  Text name = Text();  // set by its owner (`C:name`); may be empty
  bool has_busy = false;
  bool busy = false;  // a host other than the asking one controls it
  bool has_asked = false;
  std::uint32_t asked = 0;     // packet number of the question
  SessionId sid = no_session;  // of the asking host
  Text wiring = Text();        // only in the answer to Q:WIRING: read_board_wiring()
};
// False if the datagram's I field is not of that form; `out` is only written on success.
R4LINK_API bool read_identity(const Datagram& datagram, Identity& out);

struct SafeReport {
  SafeReport() = default;
  SafeReport(SafeReason why) : reason(why) {}  // NOLINT(google-explicit-constructor)
  SafeReason reason = SafeReason::none;
  // Number of the newest cause that only E:CLEAR ends, for E:CLEAR to name; 0: none.
  std::int32_t cause = 0;
  // Number of the newest obeyed E:STOP, if it had one, while the stop lasts.
  bool has_stop = false;
  std::uint32_t stop = 0;
};

// The report of a heartbeat or a state. An invalid SAFE is a fault, an invalid CAUSE or STOP none.
R4LINK_API SafeReport heartbeat_report(const Datagram& datagram);
// True if the board waits for a host (CONNECTING): PNum is 0, and T too without a nonce.
R4LINK_API bool is_connecting_heartbeat(const Datagram& datagram);

// The datagram without its secrets, for every receiver other than the board. Each secret becomes at
// most three dots, and the checksum fits the result: "C:key,1:...;PNum:66;T:79146;^0x…^". In
// invalid datagrams the first secret and all later bytes become dots. Returns `bytes` if there is
// no secret, otherwise a view of `room`, which must hold bytes.size() + masking_room characters.
constexpr std::size_t masking_room = 8;  // the new checksum may have more digits
R4LINK_API Text without_secrets(Text bytes, char* room);

}  // namespace r4
