// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include "commands/command_help.hpp"
#include "r4link/commands/command_text.hpp"
#include "r4link/link.hpp"
#include "session/session.hpp"

namespace r4 {

namespace {

struct Words {
  std::string reason;
  std::string fix;
};

struct CauseWords {
  const char* name;
  const char* reason;
  const char* fix;
};

constexpr CauseWords link_rows[] = {
    {"transport down", "the transport is down: unplugged, or its interface is switched off",
     "plug it in or switch it on; it is then opened again automatically"},
    {"two boards", "the paths lead to two boards", "give the URLs of one board"},
    {"watchdog", "the application watchdog has stopped our heartbeats and commands",
     "call feed() at least once in the watchdog's period; give each call that waits a timeout "
     "below that period"},
    {"callback", "a callback does not return, so our heartbeats and commands have stopped",
     "do the work of the callback in another thread; BoardOptions::callback_limit is its time "
     "limit"},
    {"foreign frames",
     "the board's command id (0x180 + node) carries frames that are not R4 datagrams: another "
     "protocol, such as CANopen, uses the id",
     "find the ids in use with r4 bus can://INTERFACE; give the board a node whose ids are free, "
     "or give the other device another id"},
    {"busy", "another host controls the board",
     "end the other host; control becomes free when its heartbeats have stopped for the board's "
     "timeout (1 s)"},
    {"board has no key",
     "the board has no key and obeys every host; a program with a key does not control it",
     "give the board this program's key over USB (r4 key give FILE URL), or open the board "
     "without a key"},
    {"key needed", "the board obeys only hosts that have its key",
     "open the board with the key: --key FILE or R4_KEY of r4, SessionOptions::key in a program"},
    {"key not taken",
     "the board does not accept datagrams that are signed with our key, or does not receive them",
     "check that both have the same key (r4 key give FILE URL, over USB), and that a round trip "
     "takes less than 250 ms"},
    {"watchers full", "the board has reached its limit of watchers",
     "end one of these programs; its place is free two seconds later"},
    {"not watchable", "the board's firmware streams only to the host that controls the board",
     "update the firmware, or take control: r4 monitor --control, BoardRole::control"},
    {"late frames",
     "flow control of the board does not come within 20 ms: the bus, a tunnel or an adapter "
     "delays or loses frames",
     "use the bus without the slow part, because ISO-TP needs each frame within 10 ms; `r4 bench` "
     "measures the round trip"},
    {"other board", "a path leads to another board and is not used", "give the URLs of one board"},
};
static_assert(std::size(link_rows) == static_cast<std::size_t>(LinkCause::other_board) + 1);

CauseWords words_of(LinkCause cause) {
  const auto row = static_cast<std::size_t>(cause);
  return row < std::size(link_rows) ? link_rows[row] : CauseWords{"", "", ""};
}

constexpr const char* clear_on_purpose =
    "clear it on purpose: r4 send URL E:CLEAR, or board.send(\"E:CLEAR\"), ";

// Why outputs are off, and the action before arm().
constexpr CauseWords disarm_rows[] = {
    {"none", "", ""},
    {"not yet", "a session begins disarmed", ""},
    {"stop", "an emergency stop came", "when the danger is over, "},
    {"handle", "the dead-man's handle was released", "hold the handle, "},
    {"proximity", "an obstacle is nearer than a proximity threshold", "clear the way, "},
    {"watchdog", "a task of the board's firmware missed its deadline", "find out why, "},
    {"fault", "the board found a fault in itself", "check its chips and wiring, "},
    {"link", "the link was lost, and the board did not restore its outputs", ""},
    {"restart", "the board has restarted", "set its thresholds (U) again, "},
    {"supply", "relay 1, the motor supply, was opened", ""},
    {"sleep", "this computer slept", ""},
    {"earlier stop", "an emergency stop came before this program began", clear_on_purpose},
    {"earlier watchdog",
     "a task of the board's firmware missed its deadline before this program began",
     clear_on_purpose},
    {"earlier fault", "the board found a fault in itself before this program controlled it",
     clear_on_purpose},
};
static_assert(std::size(disarm_rows) == static_cast<std::size_t>(DisarmCause::earlier_fault) + 1);

CauseWords words_of(DisarmCause cause) {
  const auto row = static_cast<std::size_t>(cause);
  return row < std::size(disarm_rows) ? disarm_rows[row] : CauseWords{"unknown", "", ""};
}

Words wiring_words(ChipTrouble trouble) {
  switch (trouble) {
    case ChipTrouble::not_confirmed:
      return {"the board is safe: its wiring is not confirmed",
              "compare the plan with the board's schematic (r4 wiring show serial:auto), then "
              "confirm it: r4 wiring confirm serial:auto; or send E:CLEAR after each start"};
    case ChipTrouble::other_bus:
      return {
          "the board is safe: its chips do not answer on the I2C bus of its wiring, but on the "
          "other bus",
          "correct 'chip bus' in the wiring file: r4 wiring give FILE serial:auto, then restart "
          "the board"};
    default:
      return {"the board is safe: its stored wiring is damaged, so no signal is connected",
              "give the wiring again: r4 wiring give FILE serial:auto, then restart the board"};
  }
}

// True if a fault of the wiring, not of a chip, keeps the board safe.
bool is_of_wiring(const LinkStatus& link) {
  return link.reason == SafeReason::fault && link.chip.any() && link.chip.address == 0;
}

// Why a board is safe, and how the safe state ends.
Words safe_words(const LinkStatus& link) {
  switch (link.reason) {
    case SafeReason::link:
      return {"the board is safe: it does not hear our heartbeats",
              "check the path from this computer to the board (firewall, cable); the link then "
              "comes back automatically"};
    case SafeReason::stop:
      return {"the board is safe: an emergency stop is latched",
              "send E:CLEAR when the danger is over"};
    case SafeReason::handle:
      return {"the board is safe: the dead-man's handle is released", "hold the handle"};
    case SafeReason::proximity:
      return {
          "the board is safe: an obstacle is nearer than a proximity threshold, or a sensor does "
          "not answer",
          "check US1 to US4 of the state (F:DEFAULT,US1,US2,US3,US4), clear the way, or change the "
          "threshold with U:cm,ch (0 turns it off)"};
    case SafeReason::watchdog:
      return {"the board is safe: a task of its firmware missed its deadline",
              "find the cause, then send E:CLEAR or restart the board"};
    case SafeReason::fault:
      if (is_of_wiring(link)) return wiring_words(link.chip.trouble);
      if (link.chip.any()) {
        return {fmt::format("the board is safe: {}: {}", chip_name(link.chip.address),
                            to_text(link.chip.trouble)),
                "check that chip's supply and wiring, then send E:CLEAR"};
      }
      return {"the board is safe: it found a fault in itself",
              "check the board's chips and wiring, then send E:CLEAR or restart the board"};
    case SafeReason::none:
      break;
  }
  return {
      "the board is safe",
      "find the reason in the board's SAFE field; E:CLEAR clears a stop, a fault and a watchdog"};
}

// Reported only without another cause, because an unused path does not disturb the other paths.
constexpr LinkCauses harmless{LinkCause::other_board};

Words link_words(const LinkStatus& link) {
  if (const auto cause = link.causes.without(harmless).first()) {
    const CauseWords words = words_of(*cause);
    const bool unheard = cause == LinkCause::late_frames && link.reason == SafeReason::link;
    return {(unheard ? "the board does not hear our heartbeats: " : "") + std::string(words.reason),
            words.fix};
  }
  switch (link.state) {
    case HostLinkState::connecting:
      return {"nothing was received from the board yet",
              "check that the board is switched on and connected, and that the URL is correct"};
    case HostLinkState::lost:
      return {"the board is silent",
              "check the board's power, cable and network; the link then comes back automatically"};
    case HostLinkState::safe:
      return safe_words(link);
    case HostLinkState::active:
      break;
  }
  if (!link.in_control) {
    return {"the board streams its state, but has not confirmed a command of this program yet",
            "allow more time; `r4 bench` shows how many datagrams are lost"};
  }
  if (const auto cause = link.cause()) return {words_of(*cause).reason, words_of(*cause).fix};
  return {"the board is active and accepts our commands", ""};
}

// In the functions below, `command` is null for a request that is not a command.

bool is(CommandKind kind, const Command* command) {
  return command != nullptr && command->kind == kind;
}

bool sets(std::string_view key, const Command* command) {
  return is(CommandKind::setting, command) && command->text == Text(key);
}

Words refusal_words(const Command* command, Refusal code, const LinkStatus& link) {
  const std::string refused = fmt::format(
      "refused by the board: {}", std::string_view(name_of(code).data(), name_of(code).size()));
  const std::string reason = fmt::format("{} ({})", refused, meaning_of(code));
  switch (code) {
    case Refusal::unknown:
    case Refusal::format:
    case Refusal::range:
    case Refusal::channel:
      // An invalid key is never sent, so RANGE means that the board has no room for the key.
      if (code == Refusal::range && sets("key", command)) {
        return {fmt::format("{} (it holds at most {} keys)", refused, max_keys),
                "remove a key: C:key,id:off"};
      }
      if (code == Refusal::range && (sets("timeout", command) || sets("heartbeat", command))) {
        return {
            reason,
            "keep the board's heartbeat interval below its timeout, and set both in one step: r4 "
            "send URL C:timeout,MS C:heartbeat,MS or link_timing()"};
      }
      // The host checks the number of the UART before it sends the command.
      if (code == Refusal::channel && is(CommandKind::uart_write, command)) {
        return {fmt::format("{} (the UART is off)", refused),
                fmt::format("switch it on, such as C:uart{},115200:8N1", command->channel)};
      }
      if (command != nullptr) return {reason, bad_command(*command, code).fix};
      return {reason, "check the board with r4 monitor, then try again"};
    case Refusal::safe: {
      if (link.state != HostLinkState::safe) {
        return {reason, "find the reason in the board's SAFE field"};
      }
      const Words why = safe_words(link);
      return {fmt::format("{} ({})", refused, why.reason), why.fix};
    }
    case Refusal::busy:
      return {reason, words_of(LinkCause::busy).fix};
    case Refusal::stale:
      return {reason, is(CommandKind::clear, command)
                          ? "check the robot, because a stop or fault may have come since; then "
                            "send the command again"
                          : "send the command again if you still need it"};
    case Refusal::auth:
      return {reason, is(CommandKind::setting, command) && is_site_setting(command->text)
                          ? "send the command over USB: serial:auto"
                          : words_of(LinkCause::key_needed).fix};
    case Refusal::full:
      return {reason, "send the command again when the present transfer has ended"};
    case Refusal::none:
    case Refusal::duplicate:
      break;
  }
  return {reason, ""};
}

// Causes that hold back heartbeats, commands or states, but not a stop.
constexpr LinkCauses passed_by_a_stop{LinkCause::watchdog,         LinkCause::callback,
                                      LinkCause::foreign_frames,   LinkCause::busy,
                                      LinkCause::board_has_no_key, LinkCause::key_needed,
                                      LinkCause::key_not_taken,    LinkCause::watchers_full,
                                      LinkCause::not_watchable,    LinkCause::late_frames};

Words unconfirmed_stop_words(const CommandResult& result, LinkStatus link) {
  link.causes = link.causes.without(passed_by_a_stop);
  Words why = link_words(link);
  if (link.state == HostLinkState::active && !link.causes.has(LinkCause::transport_down)) {
    why = {"the board streams its state, and reports no stop", ""};
  }
  const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(result.elapsed).count();
  Words words{result.outcome == Outcome::timed_out
                  ? fmt::format("the stop was not confirmed within {} ms: {}", ms, why.reason)
              : result.outcome == Outcome::full
                  ? "the stop was sent once and not confirmed, because 16 stops are under way"
                  : "the stop was not confirmed: the board was closed, or the wait was cancelled",
              std::string(stop_last_resort)};
  if (!why.fix.empty()) words.fix += "; " + why.fix;
  return words;
}

Words outcome_words(const Command* command, const CommandResult& result, const LinkStatus& link) {
  if (is(CommandKind::stop, command) && result.outcome != Outcome::confirmed) {
    return unconfirmed_stop_words(result, link);
  }
  switch (result.outcome) {
    case Outcome::confirmed:
      return {"confirmed by the board's state", ""};
    case Outcome::refused:
      if (result.transfer.outcome != I2cOutcome::done) {
        Problem why = failed_transfer({}, result.transfer.outcome);
        return {std::move(why.reason), std::move(why.fix)};
      }
      // Without a code, the board did not refuse the command: the link cannot begin.
      return result.code == Refusal::none ? link_words(link)
                                          : refusal_words(command, result.code, link);
    case Outcome::timed_out: {
      if (result.at == 0 && result.executed != 0) {  // a transfer, not a group
        return {"the transfer has begun, and its end was not reported in time",
                "give the transfer more time, or check the field I2CX"};
      }
      const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(result.elapsed).count();
      if (link.state == HostLinkState::active && link.causes.without(harmless).empty()) {
        return {
            fmt::format("not confirmed within {} ms; the command may or may not have been executed",
                        ms),
            "allow more time, or send the command again; `r4 bench` shows how many datagrams are "
            "lost"};
      }
      const Words why = link_words(link);
      return {fmt::format("not confirmed within {} ms: {}", ms, why.reason), why.fix};
    }
    case Outcome::cancelled:
      return {
          "cancelled: by a stop, by a newer reason to be safe, by a restart of the board, or by "
          "the program",
          "find the cause before you clear the board or repeat the command"};
    case Outcome::closed:
      return {"given up: the board was closed", "open the board again"};
    case Outcome::blocked:
      return {"not confirmed: the board's thread does not answer",
              "let the functions of your own transport return at once"};
    case Outcome::full:
      return {fmt::format("not sent: {} commands are under way already", Session::max_pending),
              "wait until some commands are confirmed"};
    case Outcome::not_armed: {
      if (result.disarmed == DisarmCause::earlier_fault && is_of_wiring(link)) {
        const Words why = safe_words(link);
        return {"not armed: " + why.reason, why.fix};
      }
      Problem why = explain("", result.disarmed);
      return {std::move(why.reason), std::move(why.fix)};
    }
    case Outcome::none:
      break;
  }
  return {};
}

std::string group_words(std::size_t size, const CommandResult& result) {
  if (size == 1) return "";
  if (result.executed != 0) {
    return fmt::format("; it is command {} of {}, and the commands before it were executed",
                       result.at, size);
  }
  if (result.outcome != Outcome::refused && result.outcome != Outcome::not_armed) return "";
  return fmt::format("; none of the {} commands was executed", size);
}

Problem problem_of(std::string thing, Words words, const CommandResult& result) {
  return {.kind = ErrorKind::refused,
          .thing = std::move(thing),
          .reason = std::move(words.reason),
          .fix = std::move(words.fix),
          .outcome = result.outcome,
          .refusal = result.code,
          .at = result.at};
}

}  // namespace

const char* to_text(LinkCause cause) { return words_of(cause).name; }
const char* to_text(DisarmCause cause) { return words_of(cause).name; }

const char* to_text(TransportTrouble trouble) {
  if (trouble == TransportTrouble::foreign_frames) return to_text(LinkCause::foreign_frames);
  return trouble == TransportTrouble::late_frames ? to_text(LinkCause::late_frames) : "none";
}

Problem explain(LinkCause cause) {
  const CauseWords words = words_of(cause);
  return {ErrorKind::refused, words.name, words.reason, words.fix};
}

Problem explain(std::string_view what, DisarmCause cause) {
  const CauseWords words = words_of(cause);
  const std::string first = words.fix;
  return {ErrorKind::refused, std::string(what), "not armed: " + std::string(words.reason),
          first + (first.empty() ? "call arm()" : "then call arm()")};
}

Problem explain(std::string_view name, const LinkStatus& link) {
  Words words = link_words(link);
  return {ErrorKind::refused, std::string(name), std::move(words.reason), std::move(words.fix)};
}

Problem explain(const std::vector<PathStatus>& paths) {
  std::string names;
  std::string boards;
  for (const PathStatus& path : paths) {
    const bool unnamed = path.board_id.empty();  // on a bus, a watcher does not send Q:ID
    if (unnamed && path.state != PathState::other_board) continue;
    names += (names.empty() ? "" : ", ") + path.name;
    boards += (boards.empty() ? "" : ", ") + path.name + " to " +
              (unnamed ? "a board with another clock" : path.board_id);
  }
  return {ErrorKind::refused, std::move(names), "the paths lead to two boards: " + boards,
          "give the URLs of one board, or open each board alone"};
}

Problem explain(const Command& command, const CommandResult& result, const LinkStatus& link) {
  return problem_of(shown(command), outcome_words(&command, result, link), result);
}

Problem explain(const Setpoints& group, const CommandResult& result, const LinkStatus& link) {
  const bool named = result.at >= 1 && result.at <= group.size();
  const Command failed = group[named ? result.at - 1U : 0U];
  Words words = outcome_words(&failed, result, link);
  words.reason += group_words(group.size(), result);
  return problem_of(named ? shown(failed) : shown(group), std::move(words), result);
}

Problem explain(std::string_view request, const CommandResult& result, const LinkStatus& link) {
  return problem_of(std::string(request), outcome_words(nullptr, result, link), result);
}

}  // namespace r4
