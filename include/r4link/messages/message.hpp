// SPDX-License-Identifier: GPL-3.0-or-later
// What kind of message a datagram is, and what refusals and identifications say. Portable.
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
  command,          // one of command.hpp's letters, or several
  nack,             // N:<PNum>,<code>
  identity,         // I:R4,<firmware>,<board id>,<capabilities>;NAME:…;BUSY:…;ASKED:…
  state,            // anything else
};

// "heartbeat" (both sides'), "command", "nack", "identity", "state": the `type` of `r4 decode`.
R4LINK_API const char* to_text(MessageKind kind);

R4LINK_API MessageKind kind_of(const Datagram& datagram);

// False if the datagram's N field is not of that form; `out` is only written on success.
R4LINK_API bool read_nack(const Datagram& datagram, Nack& out);

// What a board says of itself; views of the datagram. `NAME` and `BUSY` are fields of their own, so
// that older readers pass over them. Not every board sends them.
struct Identity {
  Text firmware;       // "0.1.0"
  Text board_id;       // serial number, unique; is_board_id()
  Text capabilities;   // words joined by '+': "udp+serial+leave"
  Text name = Text();  // that its owner gave it (`C:name`); empty: none
  bool has_busy = false;
  bool busy = false;  // another host than the one that asked controls it
  bool has_asked = false;
  std::uint32_t asked = 0;     // the number of the question
  SessionId sid = no_session;  // of the host that asked
};
// False if the datagram's I field is not of that form; `out` is only written on success.
R4LINK_API bool read_identity(const Datagram& datagram, Identity& out);

// Why the board is in the safe state, as its heartbeats report it.
struct SafeReport {
  SafeReport() = default;
  SafeReport(SafeReason why) : reason(why) {}  // NOLINT(google-explicit-constructor)
  SafeReason reason = SafeReason::none;
  // The number of the newest cause that only E:CLEAR ends, which E:CLEAR has to name; 0: there is
  // none.
  std::int32_t cause = 0;
  // The number of the newest E:STOP that was obeyed, if that had one, while the stop lasts.
  bool has_stop = false;
  std::uint32_t stop = 0;
};

// The report of a board heartbeat; the reason of a state, too. A SAFE that cannot be read counts as
// a fault, a CAUSE or STOP that cannot be read as none.
R4LINK_API SafeReport heartbeat_report(const Datagram& datagram);
// True if a board heartbeat says that the board waits for a host, in CONNECTING. Its PNum is 0
// then, and its T too, unless it has a nonce.
R4LINK_API bool is_connecting_heartbeat(const Datagram& datagram);

// The datagram as it may leave the program to anything but the board. Up to three dots remain of
// each secret, and the checksum is that of the result:
// "C:key,1:...;PNum:66;T:79146;^0x…^". In bytes that are not a valid datagram, the first secret and
// all bytes after it become those dots. Returns `bytes` if there is no secret, else the result in
// `room`, which must have room for bytes.size() + masking_room characters.
constexpr std::size_t masking_room = 8;  // a checksum may be written with more digits
R4LINK_API Text without_secrets(Text bytes, char* room);

}  // namespace r4
