// SPDX-License-Identifier: GPL-3.0-or-later
// Options of the blocking board (board.hpp) and the asynchronous one (async_board.hpp).
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

// take_control() and release_control() change the role.
enum class BoardRole : std::uint8_t {
  control,  // sends heartbeats, and commands when no other host controls the board
  watch,    // reads states without control; may only stop the board
};
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
  // States per second for a watcher, 1-1000; limited by the board's `rate`. On a CAN bus, a watcher
  // also receives states that are sent to other programs.
  int watch_rate_hz = 100;
  LinkTiming timing;
  // Whether output commands need arm(), also after most safe states (Board::arm()).
  Arming arming = Arming::required;
  // The state fields to request, as in F. SAFE and CMD, and RELAYS for arming, are added. Empty: F
  // is neither sent nor changed. "DEFAULT" of a watcher: the fields of the controlling host.
  std::string fields = "DEFAULT";
  std::chrono::milliseconds command_retry{50};
  std::chrono::milliseconds stop_retry{20};
  // How long a stop is repeated after it is confirmed.
  std::chrono::milliseconds stop_linger{200};
  // Period of Q:ID; 0: never. Without Q:ID, the round trip and ReceivedState::sampled_error stay
  // unknown, and with one path identity() stays empty until identify() or a group is sent.
  std::chrono::milliseconds identify_interval{1000};
  // Each host needs its own key id: with a shared id, the slower host looks like a replay.
  std::optional<Key> key;
  // Start of the session's clock, us since 1970. A restarted host must continue above used values.
  Time clock_start{0};
};

struct BoardOptions {
  BoardRole role = BoardRole::control;
  SessionOptions session;
  // Board only: if the callbacks of one event take longer, the heartbeats stop and the board goes
  // safe. When the callbacks end, the heartbeats resume. At most one hour; 0: off.
  std::chrono::milliseconds callback_limit{500};
  // Board only: a waiting call calls on_wait() every 50 ms, on the thread of the call. An exception
  // from on_wait() ends the call like a timeout: an unsent command is never sent, except a stop.
  std::function<void()> on_wait;
};

// Reads a key file: one line, `<id>:<64 hexadecimal digits>`, as `r4 key new` makes it.
//     r4::BoardOptions options;
//     options.session.key = r4::load_key("/home/me/.r4-key");
//     r4::Board board("udp://192.168.0.125", options);
//
// Throws Error: open if the file cannot be read, permission if users other than its owner may read
// or write it, data if it holds no key. If root owns the file, the file's group may read it.
R4LINK_API Key load_key(const std::string& path);

}  // namespace r4
