// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/commissioning/commissioning.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>

#include "check_functions.hpp"
#include "r4link/error.hpp"
#include "r4link/tables/state_fields.hpp"
#include "r4link/wiring/wiring_file.hpp"

namespace r4::commissioning {
namespace {

using namespace std::chrono_literals;

// If the board's wiring has changed, results that learnt something are discarded.
void take_wiring(const BoardWiring& kept, Report& report) {
  const bool changed = !report.wiring_source.empty() && kept.wiring != report.wiring;
  if (kept.source == WiringSource::given && !kept.in_use) {
    throw Error(ErrorKind::usage, "the board", "the board stores a wiring that it does not use yet",
                "press the reset button of the board, and restart this command");
  }
  report.wiring_source = to_text(kept.source);
  report.wiring = kept.wiring;
  if (!changed) return;
  for (CheckResult& each : report.checks) {
    if (each.learnt.empty()) continue;
    each = CheckResult{each.id};
    each.note = "the wiring of the board has changed since this check";
  }
}

void identify(BoardUnderTest& board, Report& report) {
  board.wait_heard();
  try {
    const BoardIdentity identity = board.identify();
    if (!report.board_id.empty() && report.board_id != identity.board_id) {
      throw Error(ErrorKind::usage, report.board_id,
                  "the report does not belong to board " + identity.board_id,
                  "start a new report for this board");
    }
    report.board_id = identity.board_id;
    report.board_name = identity.name;
    report.firmware = identity.firmware;
    report.capabilities = identity.capabilities;
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::refused || !report.board_id.empty()) throw;
    return;
  }
  try {
    take_wiring(board.wiring(), report);
  } catch (const Error& error) {  // the board reports the wiring only on its own cable
    if (error.kind() != ErrorKind::refused) throw;
  }
}

void require_section(Checking& c) {
  if (c.check.section == Section::supply_off) {
    return c.require(Topic::supply_off,
                     "Make sure that the motor supply is OFF: its plug is out, or its switch is "
                     "off. The carrier and the Giga have their supply. Confirm.",
                     "the motor supply was not off");
  }
  c.require(Topic::wheels_off_ground,
            "In the next checks motors turn. Make sure that the wheels are OFF THE GROUND, that "
            "people do not touch the robot, that the emergency switch is within reach, and that "
            "the Giga is not supplied by USB alone. Confirm.",
            "the wheels were not off the ground");
}

// A check that is skipped because its thing is not connected has a note.
bool is_skipped(const CheckResult& result) {
  return result.status == Status::skipped && result.note.empty();
}

bool is_done(const CheckResult& result) {
  return result.status != Status::not_done && result.status != Status::unsupported &&
         !is_skipped(result);
}

std::string differences(const Wiring& before, const Wiring& after) {
  std::string text;
  for (int i = 0; i < signal_count; ++i) {
    if (before.places[i] == after.places[i]) continue;
    text += fmt::format("{}{}: {} -> {}", text.empty() ? "" : "; ", signal_name(i),
                        place_name(i, before.places[i]), place_name(i, after.places[i]));
  }
  return text;
}

double shown_volts(Checking& c, int input) {
  c.board.forget_states();
  double sum = 0;
  const auto states = c.collect(200ms);
  for (const State& state : states) sum += state.volts(static_cast<Analog>(input - 1));
  return sum / static_cast<double>(states.size());
}

void set_full_scale(Checking& c, int input, double volts) {
  const Text name = r4::name_of(state_field(FieldKind::analog, input));
  const std::string value = fmt::format("{:.2f}", volts);
  c.send(Command::setting(name, Text(value)));
}

// The board does not report its full scale. It follows from the voltage that the board shows with a
// known full scale.
void give_full_scale(Checking& c, const Learnt& learnt) {
  constexpr double known = 50;
  const int input = learnt.signal - signals::analog + 1;
  const Text name = r4::name_of(state_field(FieldKind::analog, input));
  c.select_fields(std::string(name.data(), name.size()));
  const double before = shown_volts(c, input);
  if (before < 1) {
    return c.say("There is no voltage at " + std::string(name.data(), name.size()) +
                 " now: do the check of this input again, and keep the voltage connected.");
  }
  set_full_scale(c, input, known);
  const double with_known = shown_volts(c, input);
  const double present = known * before / with_known;
  set_full_scale(c, input, present * learnt.factor);
  c.measured(std::string(name.data(), name.size()) + ", full scale", present * learnt.factor, "V");
}

void forget_learnt(Report& report, bool full_scales) {
  for (CheckResult& check : report.checks) {
    std::erase_if(check.learnt, [&](const Learnt& each) {
      return (each.what == Learnt::What::full_scale) == full_scales;
    });
  }
}

// The outputs that agree with the unconfirmed plan; 0 if a check disagrees or was not done.
int outputs_as_planned(const Report& report) {
  if (report.wiring_source != to_text(WiringSource::plan) || !report.found().empty()) return 0;
  int outputs = 0;
  for (const Check& check : checks()) {
    const auto result = std::find_if(report.checks.begin(), report.checks.end(),
                                     [&](const CheckResult& each) { return each.id == check.id; });
    if (result == report.checks.end() || result->status == Status::not_done ||
        is_skipped(*result)) {
      return 0;
    }
    if (result->status == Status::passed && !check.moves.empty()) ++outputs;
  }
  return outputs;
}

void offer_wiring(Checking& c, Report& report) {
  if (report.wiring_source.empty()) return;
  const Wiring learnt = learnt_wiring(report);
  const bool as_planned = learnt == report.wiring;
  const int outputs = outputs_as_planned(report);
  if (as_planned && outputs == 0) return;
  const WiringCheck fault = r4::check(learnt);
  if (fault.fault != WiringFault::none) {
    return c.say("The learnt wiring is not complete yet: " + problem_of(learnt, fault).text() +
                 ". Also check the other signals of this kind.");
  }
  if (!c.confirms(
          Topic::give_wiring,
          as_planned
              ? fmt::format("All {} checks of outputs agree with the plan. Shall the board {} "
                            "store the plan as its wiring? The board then drives without E:CLEAR.",
                            outputs, report.board_id)
              : fmt::format("Shall the board {} store the learnt wiring? {}. The board uses this "
                            "wiring after its next start.",
                            report.board_id, differences(report.wiring, learnt)))) {
    return;
  }
  c.board.give_wiring(learnt);
  const BoardWiring kept = c.wiring_after_restart();
  if (kept.source != WiringSource::given || !kept.in_use || kept.wiring != learnt) {
    return c.found(Finding::not_kept);
  }
  c.note("the board has stored the wiring, and uses it" +
         (as_planned ? std::string(": the plan") : ": " + differences(report.wiring, learnt)));
  report.wiring_source = to_text(kept.source);
  report.wiring = kept.wiring;
  forget_learnt(report, false);
}

void offer_settings(Checking& c, Report& report) {
  std::vector<Learnt> scales;
  for (const CheckResult& result : report.checks) {
    std::copy_if(result.learnt.begin(), result.learnt.end(), std::back_inserter(scales),
                 [](const Learnt& each) { return each.what == Learnt::What::full_scale; });
  }
  if (scales.empty() || report.wiring_source.empty()) return;
  std::string list;
  for (const Learnt& each : scales) {
    list += fmt::format("{}{} x {:.4f}", list.empty() ? "" : ", ", signal_name(each.signal),
                        each.factor);
  }
  if (!c.confirms(Topic::give_settings,
                  "Shall the board store the calibration of its analog inputs, new full scale = "
                  "present full scale x factor? " +
                      list + ".")) {
    return;
  }
  forget_learnt(report, true);  // a factor refers to the present full scale, which changes now
  for (const Learnt& each : scales) give_full_scale(c, each);
}

}  // namespace

Commissioning::Commissioning(BoardUnderTest& board, Person& person, Report begun)
    : board_(board), person_(person), report_(std::move(begun)) {
  report_.software = R4LINK_VERSION;
}

CheckResult& Commissioning::result_of(const Check& check) {
  const auto place_of = [](std::string_view id) {
    return std::find_if(checks().begin(), checks().end(),
                        [&](const Check& each) { return each.id == id; });
  };
  const auto own = place_of(check.id);
  auto at = report_.checks.begin();
  while (at != report_.checks.end() && place_of(at->id) < own) ++at;
  if (at == report_.checks.end() || at->id != check.id) at = report_.checks.insert(at, {check.id});
  return *at;
}

Commissioning::End Commissioning::run(std::string_view id) { return run(check_named(id)); }

// Sets the status of the result. Returns the person's choice to skip, repeat or leave, if any.
std::optional<Answer::Kind> Commissioning::carry_out(CheckResult& result,
                                                     const std::function<void()>& work) {
  try {
    work();
    result.status = result.found.empty() ? Status::passed : Status::found;
  } catch (const Ended& ended) {
    result = CheckResult{result.id};
    result.status = Status::skipped;
    return ended.kind;
  } catch (const NotDone& not_done) {
    result.status = result.found.empty() ? not_done.status : Status::found;
    result.note = not_done.note;
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::refused || !is_heard(board_.link().state)) throw;
    result.status = result.found.empty() ? Status::not_done : Status::found;
    result.note = error.problem().text();
  }
  return std::nullopt;
}

Commissioning::End Commissioning::run(const Check& check) {
  if (!identified_) identify(board_, report_);
  identified_ = true;
  bool& ready = ready_[static_cast<int>(check.section)];
  ready_[1 - static_cast<int>(check.section)] = false;  // the supply may have been switched since
  for (;;) {
    CheckResult result{check.id};
    const auto instead = carry_out(result, [&] {
      Checking checking(board_, person_, check, report_, result);
      if (!ready) require_section(checking);
      ready = true;
      checking.say(check.about);
      function_of(check)(checking, check.channel);
    });
    if (instead == Answer::Kind::leave) return End::left;
    if (instead == Answer::Kind::repeat) continue;
    result_of(check) = result;
    if (on_result) on_result(result);
    return End::done;
  }
}

Commissioning::End Commissioning::run_all(const std::vector<std::string>& only) {
  for (const std::string& id : only) check_named(id);
  for (const Check& check : checks()) {
    const bool named = std::find(only.begin(), only.end(), check.id) != only.end();
    const auto done =
        std::find_if(report_.checks.begin(), report_.checks.end(),
                     [&](const CheckResult& each) { return each.id == check.id && is_done(each); });
    if (only.empty() ? done != report_.checks.end() : !named) continue;
    if (run(check) == End::left) return End::left;
  }
  return End::done;
}

Commissioning::End Commissioning::offer() {
  if (!identified_) identify(board_, report_);
  identified_ = true;
  const Check check{"offer", Section::supply_off, "", "", 0, 1};
  CheckResult result{check.id};
  const auto instead = carry_out(result, [&] {
    Checking checking(board_, person_, check, report_, result);
    offer_settings(checking, report_);
    offer_wiring(checking, report_);
  });
  if (instead == Answer::Kind::leave) return End::left;
  const bool given = !result.note.empty() || !result.measured.empty() || !result.found.empty();
  if (!given) return End::done;
  std::erase_if(report_.checks, [&](const CheckResult& each) { return each.id == check.id; });
  report_.checks.push_back(result);
  if (on_result) on_result(result);
  return End::done;
}

}  // namespace r4::commissioning
