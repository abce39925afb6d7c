// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <cstdlib>
#include <string_view>
#include <utility>

#include "r4link/commands/command_text.hpp"
#include "r4link/control/loop.hpp"
#include "r4link/error.hpp"
#include "r4link/tables/state_fields.hpp"

namespace r4::control {
namespace {

Error wrong(std::string reason, std::string fix) {
  return {ErrorKind::usage, "LoopOptions", std::move(reason), std::move(fix)};
}

FieldSet fields_of(std::string_view names) {
  FieldSet fields;
  while (!names.empty()) {
    const std::string_view name = names.substr(0, names.find(','));
    const StateField field = state_field(name);
    if (field == StateField::count) {
      throw wrong("this is not a state field: " + std::string(name),
                  "give names of docs/reference/protocol.md, such as ENC1, separated by commas");
    }
    fields.add(field);
    names.remove_prefix(std::min(names.size(), name.size() + 1));
  }
  return fields;
}

bool is_drive(CommandKind kind) {
  return kind == CommandKind::osmc || kind == CommandKind::dhb12 || kind == CommandKind::bldc;
}

std::string ms_text(std::chrono::milliseconds time) { return std::to_string(time.count()) + " ms"; }

}  // namespace

const char* to_text(LoopEnd end) {
  constexpr std::array texts = {"none", "asked", "late", "not active", "disarmed", "standstill"};
  static_assert(texts.size() == static_cast<std::size_t>(LoopEnd::standstill) + 1);
  const auto at = static_cast<std::size_t>(end);
  return at < texts.size() ? texts[at] : "unknown";
}

LoopGuard::LoopGuard(LoopOptions options)
    : options_(std::move(options)), needed_(fields_of(options_.fields)) {
  if (options_.late.count() <= 0 || options_.first.count() <= 0) {
    throw wrong("late or first is not a valid time", "give milliseconds above 0");
  }
  for (const Standstill& each : options_.standstill) {
    if (each.encoder < 1 || each.encoder > encoder_channels) {
      throw wrong("this is not an encoder: " + std::to_string(each.encoder), "give 1 to 4");
    }
    if (!is_drive(each.drive) || each.channel < 1 || each.channel > row_of(each.drive).channels) {
      throw wrong("a standstill names a motor that does not exist",
                  "give a channel 1 to 4 of osmc, dhb12 or bldc");
    }
    if (each.pwm <= 0 || each.counts < 0 || each.time.count() <= 0) {
      throw wrong("the duty, counts or time of a standstill is out of range",
                  "give a duty and a time above 0");
    }
    needed_.add(state_field(FieldKind::encoder, each.encoder));
    motors_.push_back({.limits = each});
  }
}

void LoopGuard::start(Clock::time_point now) {
  for (Motor& motor : motors_) motor = {.limits = motor.limits};
  got_ = FieldSet();
  last_ms_.reset();
  deadline_ = now + options_.first;
  end_ = LoopEnd::none;
  why_.clear();
}

void LoopGuard::end(LoopEnd cause, std::string why) {
  if (end_ != LoopEnd::none) return;
  end_ = cause;
  why_ = std::move(why);
}

// A state may arrive in several datagrams with the same T.
bool LoopGuard::is_ready(const ReceivedState& state) {
  if (got_ms_ != state.t_ms) got_ = FieldSet();
  got_ms_ = state.t_ms;
  got_.add(state.present);
  FieldSet all = got_;
  all.add(needed_);
  return all == got_;
}

std::optional<double> LoopGuard::on_state(const ReceivedState& state, DisarmCause disarmed,
                                          Clock::time_point now) {
  if (end_ != LoopEnd::none || !is_ready(state) || last_ms_ == state.t_ms) return std::nullopt;
  if (state.safe != SafeReason::none) {
    end(LoopEnd::not_active, std::string("the board is safe: ") + to_text(state.safe));
    return std::nullopt;
  }
  deadline_ = std::min(state.sampled, state.received) + options_.late;
  if (check(HostLinkState::active, disarmed, now) != LoopEnd::none) return std::nullopt;
  const std::int32_t passed_ms = last_ms_ ? static_cast<std::int32_t>(state.t_ms - *last_ms_) : 0;
  if (passed_ms < 0 || std::chrono::milliseconds(passed_ms) > options_.late + options_.first) {
    end(LoopEnd::not_active, "the board has restarted");
    return std::nullopt;
  }
  last_ms_ = state.t_ms;
  look_at_motors(state);
  if (end_ != LoopEnd::none) return std::nullopt;
  return passed_ms / 1000.0;
}

void LoopGuard::on_commanded(const Setpoints& setpoints) {
  for (std::size_t i = 0; i < setpoints.size(); ++i) {
    const Command command = setpoints[i];
    for (Motor& motor : motors_) {
      if (command.kind == motor.limits.drive && command.channel == motor.limits.channel) {
        motor.pwm = command.kind == CommandKind::bldc && command.on ? 0 : command.value;
      }
    }
  }
}

void LoopGuard::look_at_motors(const ReceivedState& state) {
  for (Motor& motor : motors_) {
    const Standstill& limits = motor.limits;
    const std::int32_t counts = state.encoder(limits.encoder);
    const auto turned = static_cast<std::int32_t>(static_cast<std::uint32_t>(counts) -
                                                  static_cast<std::uint32_t>(motor.counts));
    if (motor.pwm < limits.pwm || !motor.watched ||
        std::abs(std::int64_t{turned}) > limits.counts) {
      motor.watched = motor.pwm >= limits.pwm;
      motor.since_ms = state.t_ms;
      motor.counts = counts;
      continue;
    }
    if (std::chrono::milliseconds(state.t_ms - motor.since_ms) < limits.time) continue;
    end(LoopEnd::standstill, "ENC" + std::to_string(limits.encoder) + " stands still, although " +
                                 std::string(name_of(limits.drive)) + " " +
                                 std::to_string(limits.channel) + " has been driven with " +
                                 std::to_string(motor.pwm) + " for " + ms_text(limits.time) +
                                 "; check the wheel and the encoder's cable");
    return;
  }
}

LoopEnd LoopGuard::check(HostLinkState link, DisarmCause disarmed, Clock::time_point now) {
  if (end_ != LoopEnd::none) return end_;
  if (disarmed != DisarmCause::none) {
    end(LoopEnd::disarmed, std::string("output commands are refused: ") + to_text(disarmed) +
                               (disarmed == DisarmCause::not_yet ? "; call arm() first" : ""));
  } else if (link != HostLinkState::active) {
    end(LoopEnd::not_active, std::string("the link is ") + to_text(link));
  } else if (now >= deadline_) {
    const bool any = last_ms_.has_value();
    end(LoopEnd::late,
        (any ? "the newest state was sampled more than " + ms_text(options_.late) + " ago"
             : "a state did not arrive within " + ms_text(options_.first)) +
            (options_.fields.empty() ? "" : " with all of " + options_.fields) +
            "; check the link, the board's rate and the requested fields");
  }
  return end_;
}

}  // namespace r4::control
