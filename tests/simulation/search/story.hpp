// SPDX-License-Identifier: GPL-3.0-or-later
// Short stories of a board and its hosts, and the faults that a search puts into them (search.hpp).
#pragma once

#include <cstdint>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

namespace r4::simulation {

// An act of a program or a person in the story.
struct Act {
  enum class Kind : std::uint8_t {
    start,    // the host process begins
    command,  // the host commands one output
    group,    // the host commands several outputs at once
    stop,     // the host sends an emergency stop
    clear,    // the host clears its stop
    leave,    // the host sends a farewell and ends
    kill,     // the host process is killed
    reboot,   // the board restarts
    sleep,    // the host sleeps for 1.5 s
    cut,      // the path carries no datagram for 1.3 s
  };
  std::uint32_t at_ms;
  Kind kind;
  int whose = 0;  // the number of a host, or of a path
};

struct Story {
  const char* name;
  const char* text;  // what happens, in plain words
  std::vector<Act> acts;
  // After this time no datagram has a fault. Board and hosts then have time to recover from two
  // faults.
  std::uint32_t faults_until_ms = 0;
  static constexpr std::uint32_t recovery_ms = 3000;
  int hosts = 1;
  int paths = 1;
  // true: all paths are peers at one port of the board; false: each path has its own port
  bool one_port = false;
  // Bit n: the first host is on path n. Other hosts are on the last path.
  int paths_of_first = 0xFF;
  bool one_address = false;  // all hosts are one peer of the board
  bool watched = false;      // the last host only watches
  bool keys = false;         // the board has a key for each host
  bool is_short = false;     // the story has few schedules
  bool bridge = false;       // hosts and strangers reach the board through a bridge
};

const std::vector<Story>& stories();
// GoogleTest would otherwise print the bytes.
inline void PrintTo(const Story& story, std::ostream* out) { *out << story.name; }

struct Fault {
  enum class Kind : std::uint8_t {
    // Faults of a datagram.
    lost,
    twice,           // arrives twice in a row
    again_late,      // arrives, and again 300 ms later
    again_too_late,  // arrives, and again 1.3 s later
    late,            // arrives after 300 ms
    too_late,        // arrives after 1.3 s
    overtaken,       // arrives after the next datagram in its direction
    // Faults of the path on which the datagram is sent.
    cut,
    cut_to_board,
    cut_to_host,
    cut_shortly,
    held,
    unplugged,
    port_lost,
    // Faults of the host that sends or receives the datagram.
    restarts,
    dies,
    sleeps,
    pauses,
    moves,
    stops,
    clears,
    // Faults of the board and all hosts.
    reboots,
    stands_still,
    other_stops,
    bridge_restarts,
    // Acts of a stranger, which has the datagrams that the board sends to everyone and to watchers.
    stranger_beats,
    stranger_drives,
    stranger_leaves,
    stranger_clears,
    stranger_joins,
    stranger_is_paper,
    stranger_competes,
    stranger_elsewhere,
    stranger_inherits,
    stranger_copies,
    count,
  };
  int step;  // the number of the datagram in the run, from 0
  Kind kind;
  friend bool operator==(const Fault&, const Fault&) = default;
};

// A word for the command line, and a description in plain words.
const char* word_of(Fault::Kind kind);
const char* text_of(Fault::Kind kind);
constexpr bool is_of_datagram(Fault::Kind kind) { return kind <= Fault::Kind::overtaken; }
constexpr bool is_strangers(Fault::Kind kind) { return kind >= Fault::Kind::stranger_beats; }

// Converts faults to text such as "17:lost 31:restarts", and back. faults_from() throws
// std::invalid_argument.
std::string to_text(const std::vector<Fault>& faults);
std::vector<Fault> faults_from(std::string_view text);

}  // namespace r4::simulation
