// SPDX-License-Identifier: GPL-3.0-or-later
// The messages between programs that share a transport (docs/how-to/sharing.md), one a packet.
//     hello     h VERSION     to the holder: requests all datagrams, or an answer
//     ask       c VERSION     a controlling program requests the transport; answer: disconnect
//     welcome   w VERSION     the answer to hello, and to an invalid message
//     event     e u|d|! KIND THING 0 REASON 0 FIX    the transport is up, down, has a warning
//     received  r DATAGRAM    from the board
//     sent      s DATAGRAM    to the board, by any program
//     oversize  o BEGINNING   from the board: too long for a datagram
//     stop      S DATAGRAM    to the holder: an E:STOP for the board
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "r4link/carrier.hpp"
#include "r4link/datagram.hpp"
#include "r4link/error.hpp"

namespace r4 {

struct ShareMessage {
  static constexpr std::string_view version = "3";
  static constexpr std::size_t max_size = 1 + max_datagram;

  enum class Kind : char {
    hello = 'h',
    ask = 'c',
    welcome = 'w',
    event = 'e',
    received = 'r',
    sent = 's',
    oversize = 'o',
    stop = 'S',
  };

  Kind kind = Kind::hello;
  std::string_view text;  // received, sent, oversize, stop: valid as long as the packet
  CarrierEvent event;     // event
};

constexpr bool is_copy(ShareMessage::Kind kind) {
  using Kind = ShareMessage::Kind;
  return kind == Kind::received || kind == Kind::sent || kind == Kind::oversize;
}

// None if the packet is not a message of this version.
std::optional<ShareMessage> read_share_message(std::string_view packet);

// The content of an event. Cuts texts that are too long.
std::string text_of(const CarrierEvent& event);

}  // namespace r4
