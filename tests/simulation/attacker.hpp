// SPDX-License-Identifier: GPL-3.0-or-later
// An attacker on the network of a board with a key. The attacker does not have the key, but
// receives all datagrams in both directions. The attacker can send the board datagrams from any
// address, undamaged and in time.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/keys/authentication.hpp"
#include "random.hpp"

namespace r4::simulation {

// The host that sent a datagram, and the time.
struct Origin {
  int host = -1;
  std::uint32_t incarnation = 0;
  std::uint64_t at_us = 0;
};

struct Attack {
  enum class Kind : std::uint8_t {
    replay,     // a datagram that the board received, perhaps just now
    change,     // a datagram of a host, with one digit changed
    strip,      // a datagram of a host, without its signature
    heartbeat,  // a heartbeat by the attacker, with the right echo
    command,    // a command by the attacker, unsigned or with a made-up signature
    other_key,  // a command by the attacker, signed with another key, at the highest counter
    stop,       // E:STOP, which the board obeys
    count,
  };
  Kind kind = Kind::replay;
  std::string bytes;  // empty: the attacker has nothing to send
  int host = -1;      // the host whose address the attacker uses; -1: an address of its own
  Origin like;        // the origin of the datagram that the attacker repeats or changes
};
const char* to_text(Attack::Kind kind);

class Attacker {
 public:
  // The datagrams on the network: sent by a host, received by the board from a host, and sent by
  // the board.
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

  // Only datagrams that need a signature.
  std::vector<Heard> sent_;
  std::vector<Heard> received_;
  std::string nonce_;  // the board's nonce; below, the T of its newest heartbeat
  std::string echo_ = "0";
  std::uint32_t board_t_ = 0;
};

}  // namespace r4::simulation
