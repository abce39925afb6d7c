// SPDX-License-Identifier: GPL-3.0-or-later
// The error type of the host library: the problem, its reason and its fix.
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

// Not 0, so that a program can return it as its exit code.
enum class ErrorKind : std::uint8_t {
  data = 1,     // an invalid datagram, recording or file
  usage,        // a wrong URL, option or command
  refused,      // the board refused, or did not confirm in time
  open,         // the transport cannot be opened or is down
  permission,   // the system denies access
  unsupported,  // kernel support or an interface is missing
};

enum class Outcome : std::uint8_t {
  none,       // not about a command
  confirmed,  // by the board's state
  refused,    // the board refused the command and did not execute it, or a transfer failed
              // on its bus, or the link cannot begin; see Refusal
  timed_out,  // not confirmed by the deadline; the command may have been executed
  cancelled,  // ended by a stop, a newer safe cause, another clock of the board, or the program
  closed,     // ended because the board was closed
  blocked,    // the board's thread does not answer: not sent, or not confirmed
  full,       // not accepted, because 64 commands are under way
  not_armed,  // not sent: output commands, or arm() itself, are blocked by the cause in `disarmed`
};

// "confirmed", "refused", "timed out" …
R4LINK_API const char* to_text(Outcome outcome);

// Foreign text as one line that is safe for a terminal or a log. Control characters (also line feed
// and tab), invalid UTF-8, and characters without width or with direction become \xNN. Idempotent.
R4LINK_API std::string printable(std::string_view text);

struct Program {
  int pid = 0;  // 0: not known
  std::string name;
};

// A problem in words: "/dev/ttyACM0: permission denied; add yourself to the group dialout: …".
struct Problem {
  ErrorKind kind = ErrorKind::open;
  std::string thing;  // the subject: a URL, a device, a command
  std::string reason;
  std::string fix;  // may be empty
  // If the problem is about a command:
  Outcome outcome = Outcome::none;
  Refusal refusal = Refusal::none;  // for Outcome::refused
  std::uint8_t at = 0;              // failed command of a group, from 1; 0: no particular command
  // The program that already controls the transport, if this is the reason.
  std::optional<Program> holder{};

  // "thing: reason; fix" as one printable() line.
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

// Of kind open, from a system error: the system has no thread, descriptor or watch for `thing`.
R4LINK_API Problem problem_of(const std::string& thing, const std::system_error& error);

}  // namespace r4
