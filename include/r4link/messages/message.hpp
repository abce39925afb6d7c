// SPDX-License-Identifier: GPL-3.0-or-later
// The kind of a datagram, and the content of refusals and identities. Portable.
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

// "heartbeat" (for both sides), "command", "nack", "identity", "state": the `type` of `r4 decode`.
R4LINK_API const char* to_text(MessageKind kind);

R4LINK_API MessageKind kind_of(const Datagram& datagram);

// False if the datagram's N field has another form; `out` is written only on success.
R4LINK_API bool read_nack(const Datagram& datagram, Nack& out);

// A board's identity, as views of the datagram. `NAME`, `BUSY` and `ASKED` are optional fields.
struct Identity {
  Text firmware;       // "0.1.0"
  Text board_id;       // serial number, unique; is_board_id()
  Text capabilities;   // words joined by '+': "udp+serial+leave"
  Text name = Text();  // set by the owner (`C:name`); may be empty
  bool has_busy = false;
  bool busy = false;  // a host other than the asking host controls the board
  bool has_asked = false;
  std::uint32_t asked = 0;     // packet number of the question
  SessionId sid = no_session;  // of the asking host
  Text wiring = Text();        // in the answer to Q:WIRING; see read_board_wiring()
};
// False if the datagram's I field has another form; `out` is written only on success.
R4LINK_API bool read_identity(const Datagram& datagram, Identity& out);

struct SafeReport {
  SafeReport() = default;
  SafeReport(SafeReason why) : reason(why) {}  // NOLINT(google-explicit-constructor)
  SafeReason reason = SafeReason::none;
  // Number of the newest cause that only E:CLEAR ends; E:CLEAR must name it. 0: none.
  std::int32_t cause = 0;
  // Number of the newest obeyed E:STOP, while the stop lasts. has_stop: the E:STOP had a number.
  bool has_stop = false;
  std::uint32_t stop = 0;
};

// For a heartbeat or a state. An invalid SAFE is a fault; an invalid CAUSE or STOP is ignored.
R4LINK_API SafeReport heartbeat_report(const Datagram& datagram);
// True if the board waits for a host (CONNECTING): PNum is 0 and, without a nonce, T is 0.
R4LINK_API bool is_connecting_heartbeat(const Datagram& datagram);

// The datagram without secrets, for every receiver other than the board. Each secret becomes at
// most three dots, and the checksum is that of the result: "C:key,1:...;PNum:66;T:79146;^0x…^". In
// invalid datagrams the first secret and all later bytes become dots. Returns `bytes` if there is
// no secret, otherwise a view of `room`, which must hold bytes.size() + masking_room characters.
constexpr std::size_t masking_room = 8;  // the new checksum may have more digits
R4LINK_API Text without_secrets(Text bytes, char* room);

}  // namespace r4
