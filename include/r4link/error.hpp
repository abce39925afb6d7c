// SPDX-License-Identifier: GPL-3.0-or-later
// The one error type of the host: what went wrong, why, and what to do about it.
#pragma once

#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "config.hpp"
#include "vocabulary.hpp"

namespace r4 {

// What kind of trouble; the value is the exit code of `r4` (docs/transports.md).
enum class ErrorKind : int {
  data = 1,         // a datagram, a recording or a file is bad
  usage = 2,        // a URL, an option or a command is wrong
  refused = 3,      // the board refused, or did not confirm in time
  open = 4,         // the transport cannot be opened or is gone
  permission = 5,   // the system denies it
  unsupported = 6,  // kernel support or interface missing
};

// How a command ended.
enum class Outcome : std::uint8_t {
  none,       // no command is concerned
  confirmed,  // the board's own state says so
  refused,    // the board refused it, and did not execute it: the Refusal
  timed_out,  // no confirmation until the deadline; it may or may not have been executed
  cancelled,  // given up: a stop, a newer cause to be safe or another clock of the board came first, or the program did
  closed,     // given up: the board was closed
  blocked,    // the board's thread does not answer: not sent, or not confirmed
  full,       // not taken: 64 commands are under way already
  not_armed,  // not sent: it drives an output and the session is not armed, because of `disarmed`;
              // arm() itself: it cannot be armed while that is so
};

// "confirmed", "refused", "timed out" …
R4LINK_API const char* to_text(Outcome outcome);

// Text of others (a name, a host name, a line of a file) as one line that a terminal or a log may
// show. What would move the cursor, colour, hide or reorder text is written as \xNN, a byte each:
// control characters, also line feed and tab; what is not UTF-8; characters without a width, or with
// a direction of their own. Everything else stays, so that printable() of such a line changes
// nothing.
R4LINK_API std::string printable(std::string_view text);

// A program of this computer.
struct Program {
  int pid = 0;  // 0: not known
  std::string name;
};

// A problem in words: "/dev/ttyACM0: permission denied; add yourself to the group dialout: …".
struct Problem {
  ErrorKind kind = ErrorKind::open;
  std::string thing;   // what it is about: a URL, a device, a command
  std::string reason;  // why
  std::string fix;     // what to do; empty where nobody can know
  // For programs, where it is about a command.
  Outcome outcome = Outcome::none;
  Refusal refusal = Refusal::none;  // for Outcome::refused
  std::uint8_t at = 0;              // which command of a group, from 1; 0: none in particular
  // The program that controls the transport already, where that is the reason.
  std::optional<Program> holder{};

  // "thing: reason; fix", printable: one line, whatever the parts hold.
  R4LINK_API std::string text() const;
};

class R4LINK_API Error : public std::runtime_error {
 public:
  explicit Error(Problem problem)
      : std::runtime_error(problem.text()), problem_(std::move(problem)) {}
  Error(ErrorKind kind, std::string thing, std::string reason, std::string fix = {})
      : Error(Problem{kind, std::move(thing), std::move(reason), std::move(fix)}) {}
  const Problem& problem() const { return problem_; }
  ErrorKind kind() const { return problem_.kind; }
  Outcome outcome() const { return problem_.outcome; }
  Refusal refusal() const { return problem_.refusal; }
  int at() const { return problem_.at; }
  const std::optional<Program>& holder() const { return problem_.holder; }

 private:
  Problem problem_;
};

// The problem behind an error of Asio or of the standard library: the system refuses `thing` a
// thread, a descriptor, a watch. Of kind open.
R4LINK_API Problem problem_of(const std::string& thing, const std::system_error& error);

}  // namespace r4
