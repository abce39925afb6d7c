// SPDX-License-Identifier: GPL-3.0-or-later
// What both forms of the board, blocking (board.hpp) and asynchronous (async_board.hpp), take.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "config.hpp"
#include "key.hpp"
#include "link.hpp"

namespace r4 {

// What a program is to its board. take_control() and release_control() change it at run time.
enum class BoardRole : std::uint8_t {
  control,  // sends heartbeats, and commands the board as soon as no other host does
  watch,  // gets what the board says, and takes no control: it may stop the board, and nothing else
};
// "control", "watch"; "unknown" for other numbers.
constexpr const char* to_text(BoardRole role) {
  switch (role) {
    case BoardRole::control:
      return "control";
    case BoardRole::watch:
      return "watch";
  }
  return "unknown";
}

struct SessionOptions {
  // States a second for a program that watches, 1-1000; the board sends no more than its own `rate`. What else is
  // carried to the same place, as on a CAN bus, comes as well.
  int watch_rate_hz = 100;
  LinkTiming timing;
  // Must a program call arm() before it drives, and again after whatever made the outputs safe?
  Arming arming = Arming::required;
  // The state fields to ask for, as in F; SAFE and CMD, and RELAYS for arming, are added, to these and
  // to those of any F that is sent. Empty: leave the board's choice, and every F, alone. One that watches gets
  // the fields that the host in control has chosen, but for others than "DEFAULT" here.
  std::string fields = "DEFAULT";
  std::chrono::milliseconds command_retry{50};
  std::chrono::milliseconds stop_retry{20};
  // For how long a stop is repeated after it was confirmed.
  std::chrono::milliseconds stop_linger{200};
  // Q:ID, for identity and round-trip time; 0: never. Then it is not known either that the board takes a
  // farewell, and none is said, unless the program asks who it is.
  std::chrono::milliseconds identify_interval{1000};
  // The board's key. Each host has its own, by its id: of two that share one, the slower is taken for
  // a replay.
  std::optional<Key> key;
  // When the session's clock began, in microseconds since 1970: a host that begins again must go on
  // counting above what it has used.
  Time clock_start{0};
};

struct BoardOptions {
  BoardRole role = BoardRole::control;
  SessionOptions session;
  // Of Board only: after so long in the callbacks of one event the heartbeats stop, and the board goes safe, for
  // nobody looks after the robot; up to an hour, 0 turns it off. They go on when it returns.
  std::chrono::milliseconds callback_limit{500};
  // Of Board only: called by each call that waits, on its thread, every 50 ms. What it throws ends that call, as
  // its timeout does: what has not been sent by then never is, but for a stop. None: it just waits.
  std::function<void()> on_wait;
};

// A board's key from a file: one line, `<id>:<64 hexadecimal digits>`, as `r4 key new` makes it.
//
//     r4::BoardOptions options;
//     options.session.key = r4::load_key("/home/me/.r4-key");
//     r4::Board board("udp://192.168.0.125", options);
//
// Throws Error: open if it cannot be read, permission if others than its owner may read or write
// it, data if it holds no key. A file of root's may also be read by its group, as a service's is.
R4LINK_API Key load_key(const std::string& path);

}  // namespace r4
