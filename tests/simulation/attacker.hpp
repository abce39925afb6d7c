// SPDX-License-Identifier: GPL-3.0-or-later
// An attacker on the network of a board with a key. It does not have the key. It hears all
// datagrams in both directions, and sends the board datagrams from any address, whole and in time.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/keys/authentication.hpp"
#include "random.hpp"

namespace r4::simulation {

// The host that sent a datagram, and when.
struct Origin {
  int host = -1;
  std::uint32_t incarnation = 0;
  std::uint64_t at_us = 0;
};

struct Attack {
  enum class Kind : std::uint8_t {
    replay,     // a datagram that the board received, perhaps just now
    change,     // a datagram of a host, with one digit changed
    strip,      // … without its signature
    heartbeat,  // a heartbeat by the attacker, with the right echo
    command,    // a command by the attacker, unsigned or with a made-up signature
    other_key,  // … signed with another key, at the highest counter
    stop,       // E:STOP: the board obeys it
    count,
  };
  Kind kind = Kind::replay;
  std::string bytes;  // empty: the attacker knows nothing to send
  int host = -1;      // whose address it takes; -1: its own address
  Origin like;        // the datagram that it sends again, changed or not
};
const char* to_text(Attack::Kind kind);

class Attacker {
 public:
  // The datagrams on the network: sent by a host; received by the board from a host; sent by the
  // board.
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
  std::string nonce_;  // of the board; below: the T of its newest heartbeat
  std::string echo_ = "0";
  std::uint32_t board_t_ = 0;
};

}  // namespace r4::simulation
