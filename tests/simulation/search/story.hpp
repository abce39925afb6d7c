// SPDX-License-Identifier: GPL-3.0-or-later
// Short stories of a board and its hosts, and the faults that a search puts into them (search.hpp).
#pragma once

#include <cstdint>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

namespace r4::simulation {

// Something that a story's people do.
struct Act {
  enum class Kind : std::uint8_t {
    start,    // the host process begins
    command,  // the host commands one output
    group,    // … several at once
    stop,     // the host asks for an emergency stop
    clear,    // … and clears it
    leave,    // the host says farewell and ends
    kill,     // the host process dies
    reboot,   // the board restarts
    sleep,    // the host's computer sleeps for 1.5 s
    cut,      // that path carries nothing for 1.3 s
  };
  std::uint32_t at_ms;
  Kind kind;
  int whose = 0;  // a host, or of a path its number
};

struct Story {
  const char* name;
  const char* text;  // what happens, in plain words
  std::vector<Act> acts;
  // Datagrams that are sent later have no faults. A board and hosts recover from two faults in the
  // time that follows.
  std::uint32_t faults_until_ms = 0;
  static constexpr std::uint32_t recovery_ms = 3000;
  int hosts = 1;
  int paths = 1;
  bool one_port = false;      // the paths are peers at one port of the board; else each has its own
  int paths_of_first = 0xFF;  // bit n: the first host is on path n. The others are on the last path
  bool one_address = false;   // the board hears all hosts from one peer
  bool watched = false;       // a program watches, which is the last host
  bool keys = false;          // the board has a key of each host
  bool is_short = false;      // it has few schedules
  bool bridge = false;        // hosts and strangers reach the board through a bridge
};

const std::vector<Story>& stories();
// For GoogleTest, which would print its bytes.
inline void PrintTo(const Story& story, std::ostream* out) { *out << story.name; }

struct Fault {
  enum class Kind : std::uint8_t {
    // Of a datagram.
    lost,
    twice,           // comes twice, one right behind the other
    again_late,      // comes, and 300 ms later again
    again_too_late,  // … 1.3 s later
    late,            // comes after 300 ms
    too_late,        // … 1.3 s
    overtaken,       // comes behind the next in its direction
    // Of the path that the datagram is sent on.
    cut,
    cut_to_board,
    cut_to_host,
    cut_shortly,
    held,
    unplugged,
    port_lost,
    // Of the host that sends it, or that it is for.
    restarts,
    dies,
    sleeps,
    pauses,
    moves,
    stops,
    clears,
    // Of all.
    reboots,
    stands_still,
    other_stops,
    bridge_restarts,
    // Of a stranger, who knows what the board tells to all, and to those that watch.
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
  int step;  // which datagram of the run, from 0
  Kind kind;
  friend bool operator==(const Fault&, const Fault&) = default;
};

// A word for a command line, and what happens, in plain words.
const char* word_of(Fault::Kind kind);
const char* text_of(Fault::Kind kind);
constexpr bool is_of_datagram(Fault::Kind kind) { return kind <= Fault::Kind::overtaken; }
constexpr bool is_strangers(Fault::Kind kind) { return kind >= Fault::Kind::stranger_beats; }

// "17:lost 31:restarts", and back. Throws std::invalid_argument.
std::string to_text(const std::vector<Fault>& faults);
std::vector<Fault> faults_from(std::string_view text);

}  // namespace r4::simulation
