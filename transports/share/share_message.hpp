// SPDX-License-Identifier: GPL-3.0-or-later
// What programs that share a wire say to each other (docs/sharing.md): each message is one packet of a
// local socket, a letter and what belongs to it. Without I/O.
//
//     hello     h VERSION ROLE NAME             to the holder, first of all
//     welcome   w VERSION NAME                  its answer: everything else follows
//     busy      b NAME                          or this: it controls the board itself, and so must who asks
//     yours     y                               or this: it has let the wire go
//     moved     m                               to the others then: the wire is somebody else's in a moment
//     up        u WIRE                          the wire is up, and called so
//     down      d KIND THING 0 REASON 0 FIX     it is down
//     warning   ! KIND THING 0 REASON 0 FIX
//     received  r DATAGRAM                      from the board
//     sent      s DATAGRAM                      to the board, by the holder or for another, and
//                                               without secrets
//     oversize  o BEGINNING                     from the board: too long for a datagram
//     stop      S DATAGRAM                      to the holder: an E:STOP for the board
//     alive     a                               to the holder, who says it back: it does not hang
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "r4link/carrier.hpp"
#include "r4link/datagram.hpp"
#include "r4link/error.hpp"
#include "r4link/options.hpp"

namespace r4 {

struct ShareMessage {
  static constexpr char version = '2';
  static constexpr std::size_t max_size = 1 + max_datagram;
  static constexpr std::size_t max_name = 64;

  enum class Kind : char {
    hello = 'h',
    welcome = 'w',
    busy = 'b',
    yours = 'y',
    moved = 'm',
    up = 'u',
    down = 'd',
    warning = '!',
    received = 'r',
    sent = 's',
    oversize = 'o',
    stop = 'S',
    alive = 'a',
  };

  Kind kind = Kind::hello;
  bool same_version = true;             // hello, welcome; if not, the rest is empty
  BoardRole role = BoardRole::control;  // hello
  std::string_view text;                // a name, or a datagram; valid as long as the packet
  Problem problem;                      // down, warning
};

// None for what is no message of these.
std::optional<ShareMessage> read_share_message(std::string_view packet);

// What follows the letter. Names and problems are cut to fit.
std::string hello_text(BoardRole role, std::string_view name);
std::string welcome_text(std::string_view name);
std::string problem_text(const Problem& problem);

// Of a datagram of the board: of states the newest matters most; heartbeats and answers are short and few.
Priority priority_of(std::string_view datagram);

}  // namespace r4
