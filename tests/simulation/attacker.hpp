// SPDX-License-Identifier: GPL-3.0-or-later
// Somebody on the network of a board with a key, but without that key: hears all that is sent both
// ways, and sends the board what it likes, from any address, whole and in time.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/keys/authentication.hpp"
#include "random.hpp"

namespace r4::simulation {

// Whose it is, and when it was sent.
struct Origin {
  int host = -1;
  std::uint32_t incarnation = 0;
  std::uint64_t at_us = 0;
};

struct Attack {
  enum class Kind : std::uint8_t {
    replay,     // what the board has received before, be it just now
    change,     // what a host has sent, with a digit changed
    strip,      // … without its signature
    heartbeat,  // one of its own, with the right echo
    command,    // one of its own, unsigned or with a made-up signature
    other_key,  // … signed with a key of its own, at the highest counter
    stop,       // E:STOP: that one is obeyed
    count,
  };
  Kind kind = Kind::replay;
  std::string bytes;  // empty: it knows nothing to send
  int host = -1;      // whose address it takes; -1: one of its own
  Origin like;        // of what it has heard and sends again, changed or not
};
const char* to_text(Attack::Kind kind);

class Attacker {
 public:
  // What goes over the network: a host sends, the board has received what a host sent, the board
  // sends.
  void on_sent(Origin from, std::string_view bytes) { keep(sent_, from, bytes); }
  void on_received(Origin from, std::string_view bytes) { keep(received_, from, bytes); }
  void on_board(std::string_view bytes);
  Attack next(Random& random);

 private:
  struct Heard {
    std::string bytes;
    Origin from;
  };
  static void keep(std::vector<Heard>& list, Origin from, std::string_view bytes);
  std::string own(const std::string& field, const Heard& like, Random& random) const;

  // What needs a signature.
  std::vector<Heard> sent_;
  std::vector<Heard> received_;
  std::string nonce_;  // of the board, and the T of its newest heartbeat and datagram
  std::string echo_ = "0";
  std::uint32_t board_t_ = 0;
};

}  // namespace r4::simulation
