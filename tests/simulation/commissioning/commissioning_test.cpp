// SPDX-License-Identifier: GPL-3.0-or-later
// r4::commissioning with a simulated person at simulated boards that are right, not wired as
// planned, or broken.
#include "r4link/commissioning/commissioning.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bench.hpp"
#include "r4link/error.hpp"
#include "r4link/wiring/wiring_file.hpp"
#include "simulated_person.hpp"
#include "tests/support/problems.hpp"

namespace r4::simulation {
namespace {

using commissioning::Commissioning;

Wiring wired(const std::vector<std::pair<std::string, std::string>>& changes) {
  Wiring wiring = plan_wiring();
  for (const auto& [signal, place] : changes) {
    const int index = signal_named(signal);
    wiring.places[index] = place_named(index, place);
  }
  return wiring;
}

std::vector<std::string> findings_of(const commissioning::Report& report) {
  std::vector<std::string> all;
  for (const auto& each : report.found()) {
    all.push_back(each.thing + ": " + std::string(text_of(each.finding).name));
  }
  return all;
}

void expect_that_nothing_moved_unannounced(const SimulatedPerson& person) {
  EXPECT_EQ(person.unannounced_ms, 0);
  EXPECT_EQ(person.several_ms, 0);
  EXPECT_EQ(person.not_ended_ms, 0);
}

TEST(Commissioning, FindsNothingWrongAtARightBoard) {
  Bench bench({});
  SimulatedPerson person(bench);
  Commissioning commissioning(bench, person);
  EXPECT_EQ(commissioning.run_all(), Commissioning::End::done);
  EXPECT_EQ(findings_of(commissioning.report()), std::vector<std::string>{});
  for (const auto& each : commissioning.report().checks) {
    EXPECT_EQ(each.status, commissioning::Status::passed) << each.id << ": " << each.note;
  }
  EXPECT_EQ(commissioning.report().checks.size(), commissioning::checks().size());
  EXPECT_GT(person.movements, 50);
  expect_that_nothing_moved_unannounced(person);
}

TEST(Commissioning, FindsNothingWrongAtABoardThatKnowsItsOtherWiring) {
  Bench bench({.wired = wired({{"chip servo", "0x45"},
                               {"handle", "D44 low"},
                               {"input 2", "D42"},
                               {"osmc 1 pwm", "osmc.2 two-pwm"},
                               {"osmc 1 direction", "osmc.3 inverted"},
                               {"osmc 2 pwm", "osmc.0"},
                               {"osmc 2 direction", "osmc.1"},
                               {"encoder 1 a", "D27"},
                               {"encoder 1 b", "D25"},
                               {"relay 1", "GPB1 inverted"},
                               {"relay 2", "GPB0"},
                               {"analog 1", "A6"},
                               {"stepper 3 direction", "D40 inverted"}}),
               .knows_wiring = true});
  SimulatedPerson person(bench);
  Commissioning commissioning(bench, person);
  commissioning.run_all();
  EXPECT_EQ(findings_of(commissioning.report()), std::vector<std::string>{});
  EXPECT_EQ(commissioning.report().checks.size(), commissioning::checks().size());
  commissioning.offer();
  EXPECT_EQ(commissioning.report().checks.back().id, "stop") << "there is nothing to give";
  expect_that_nothing_moved_unannounced(person);
}

struct Fault {
  const char* name;
  std::vector<std::pair<std::string, std::string>> wired;  // places that differ from the plan
  std::vector<std::string> broken;                         // words of a scenario
  std::vector<std::string> found;  // all faults that must be found, and no other fault
  bool learns_all = true;          // the learnt wiring is the real wiring
};
const std::vector<Fault> faults = {
    {"two motors are exchanged",
     {{"osmc 1 pwm", "osmc.2"},
      {"osmc 1 direction", "osmc.3"},
      {"osmc 2 pwm", "osmc.0"},
      {"osmc 2 direction", "osmc.1"}},
     {},
     {"osmc 1: exchanged", "osmc 2: exchanged"}},
    {"three motors are exchanged in a circle, one of them reversed",
     {{"osmc 1 pwm", "osmc.2"},
      {"osmc 1 direction", "osmc.3"},
      {"osmc 2 pwm", "osmc.4"},
      {"osmc 2 direction", "osmc.5 inverted"},
      {"osmc 3 pwm", "osmc.0"},
      {"osmc 3 direction", "osmc.1"}},
     {},
     {"osmc 1: exchanged", "osmc 2: exchanged", "osmc 3: exchanged", "osmc 3: reversed"}},
    {"motors of two kinds are exchanged",
     {{"osmc 4 pwm", "dhb12.2"},
      {"osmc 4 direction", "dhb12.3"},
      {"dhb12 2 pwm", "osmc.6"},
      {"dhb12 2 direction", "osmc.7"}},
     {},
     {"osmc 4: exchanged", "dhb12 2: exchanged"}},
    {"the polarity of a motor is reversed",
     {{"osmc 2 direction", "osmc.3 inverted"}},
     {},
     {"osmc 2: reversed"}},
    {"a driver has two PWM inputs", {{"dhb12 3 pwm", "dhb12.4 two-pwm"}}, {}, {"dhb12 3: two pwm"}},
    {"a motor is not connected",
     {{"dhb12 4 pwm", "none"}, {"dhb12 4 direction", "none"}},
     {},
     {"dhb12 4: does not move"},
     false},
    {"a brushless driver is reversed",
     {{"bldc 3 direction", "GPA4 inverted"}},
     {},
     {"bldc 3: reversed"}},
    {"a channel of an encoder is dead",
     {},
     {"defect enc2a on"},
     {"encoder 2: encoder channel dead"}},
    {"an encoder is dead",
     {},
     {"defect enc4a on", "defect enc4b on"},
     {"encoder 4: encoder silent"}},
    {"the channels of an encoder are exchanged",
     {{"encoder 1 a", "D27"}, {"encoder 1 b", "D25"}},
     {},
     {"encoder 1: reversed"}},
    {"two encoders are exchanged",
     {{"encoder 3 a", "D37"},
      {"encoder 3 b", "D38"},
      {"encoder 3 index", "D32"},
      {"encoder 4 a", "D33"},
      {"encoder 4 b", "D35"},
      {"encoder 4 index", "D30"}},
     {},
     {"encoder 3: exchanged", "encoder 4: exchanged"}},
    {"the handle is inverted", {{"handle", "D42 low"}}, {}, {"handle: handle inverted"}},
    {"the handle is at another pin",
     {{"handle", "D44"}, {"input 2", "D42"}},
     {},
     {"handle: handle elsewhere"}},
    {"the handle is missing", {}, {"defect handle on"}, {"handle: handle missing"}},
    {"a chip is absent", {{"chip dac", "none"}}, {}, {"chip dac: chip absent"}, false},
    {"a chip has another address",
     {{"chip servo", "0x45"}},
     {},
     {"chip servo: chip at another address"}},
    {"the chips are on the other bus",
     {{"chip bus", "SDA1/SCL1"}},
     {},
     {"chip bus: chips on the other bus"}},
    {"a divider is wrong by a factor", {}, {"divider AIN24 0.5"}, {"supply AIN24: divider wrong"}},
    {"no voltage reaches an input", {}, {"divider AIN5 0"}, {"supply AIN5: no voltage"}},
    {"two analog inputs are exchanged",
     {{"analog 1", "A1"}, {"analog 2", "A0"}},
     {},
     {"supply AIN24: exchanged", "supply AIN12: exchanged"}},
    {"relay 1 is not in the supply",
     {},
     {"defect bypass on"},
     {"motor supply: relay 1 not in supply"}},
    {"a relay is stuck", {}, {"defect relay3 on"}, {"relay 3: relay dead"}},
    {"two relays are exchanged",
     {{"relay 2", "GPB4"}, {"relay 5", "GPB1"}},
     {},
     {"relay 2: exchanged", "relay 5: exchanged"}},
    {"two servos are exchanged",
     {{"servo 7", "servo.8"}, {"servo 9", "servo.6"}},
     {},
     {"servo 7: exchanged", "servo 9: exchanged"}},
    {"an echo floats", {}, {"defect echo2 on"}, {"ultrasonic 2: echo unsteady"}},
    {"an ultrasonic sensor does not answer",
     {},
     {"us 3 off"},
     {"ultrasonic 3: ultrasonic silent"},
     false},
    {"two ultrasonic sensors are exchanged",
     {{"ultrasonic 1 trigger", "D46"},
      {"ultrasonic 1 echo", "D50"},
      {"ultrasonic 2 trigger", "D39"},
      {"ultrasonic 2 echo", "D43"}},
     {},
     {"ultrasonic 1: exchanged", "ultrasonic 2: exchanged"}},
    {"a stepper is reversed",
     {{"stepper 2 direction", "D36 inverted"}},
     {},
     {"stepper 2: reversed"}},
    {"two steppers are exchanged",
     {{"stepper 1 step", "D3"},
      {"stepper 1 direction", "D36"},
      {"stepper 2 step", "D2"},
      {"stepper 2 direction", "D34"}},
     {},
     {"stepper 1: exchanged", "stepper 2: exchanged"}},
    {"a device holds the user's bus", {}, {"userbus held"}, {"user bus: user bus stuck"}},
    {"a device sends nothing", {}, {"uart 1 off"}, {"uart 1: uart silent"}},
};

TEST(Commissioning, NamesEveryFaultOfTheWiringAndNothingElse) {
  int named = 0, movements = 0;
  for (const Fault& fault : faults) {
    SCOPED_TRACE(fault.name);
    Bench bench({.wired = wired(fault.wired), .broken = fault.broken});
    SimulatedPerson person(bench);
    Commissioning commissioning(bench, person);
    EXPECT_EQ(commissioning.run_all(), Commissioning::End::done);
    EXPECT_EQ(findings_of(commissioning.report()), fault.found);
    named += findings_of(commissioning.report()) == fault.found ? 1 : 0;
    movements += person.movements;
    expect_that_nothing_moved_unannounced(person);
    if (fault.learns_all) {
      const Wiring learnt = learnt_wiring(commissioning.report());
      EXPECT_EQ(write_wiring(learnt), write_wiring(wired(fault.wired)));
    }
  }
  fmt::print("{} of {} faults named, in {} announced movements\n", named, faults.size(), movements);
}

commissioning::Answer answer_of(commissioning::Answer::Kind kind) {
  commissioning::Answer answer;
  answer.kind = kind;
  return answer;
}

TEST(Commissioning, GivesWhatItLearntAndFindsNothingAfterwards) {
  Bench bench(
      {.wired = wired(
           {{"osmc 2 direction", "osmc.3 inverted"}, {"relay 2", "GPB4"}, {"relay 5", "GPB1"}}),
       .new_board = true,
       .broken = {"divider AIN24 0.8"}});
  SimulatedPerson person(bench);
  int cleared = 0;
  person.otherwise = [&](const commissioning::Question& question) {
    cleared += question.topic == commissioning::Topic::clear ? 1 : 0;
    return std::nullopt;
  };
  Commissioning commissioning(bench, person);
  commissioning.run_all();
  EXPECT_EQ(cleared, 1);
  EXPECT_EQ(findings_of(commissioning.report()),
            (std::vector<std::string>{"supply AIN24: divider wrong", "relay 2: exchanged",
                                      "relay 5: exchanged", "osmc 2: reversed"}));
  EXPECT_EQ(commissioning.offer(), Commissioning::End::done);
  EXPECT_EQ(
      commissioning.report().checks.back().note,
      "the board has stored the wiring, and uses it: osmc 2 direction: osmc.3 -> osmc.3 inverted; "
      "relay 2: GPB1 -> GPB4; relay 5: GPB4 -> GPB1");
  Commissioning again(bench, person);
  again.run_all();
  EXPECT_EQ(findings_of(again.report()), (std::vector<std::string>{"supply AIN24: divider wrong"}))
      << "the simulated board keeps no full scale over its restart";
  expect_that_nothing_moved_unannounced(person);
}

TEST(Commissioning, NoticesThatTheBoardKeepsNothing) {
  Bench bench({.wired = wired({{"handle", "D42 low"}}), .broken = {"defect store on"}});
  SimulatedPerson person(bench);
  Commissioning commissioning(bench, person);
  commissioning.run_all({"handle"});
  commissioning.offer();
  EXPECT_EQ(findings_of(commissioning.report()),
            (std::vector<std::string>{"handle: handle inverted", "offer: not kept"}));
}

TEST(Commissioning, MovesNothingUnlessThePersonAgrees) {
  for (const auto topic : {commissioning::Topic::clear, commissioning::Topic::wheels_off_ground,
                           commissioning::Topic::supply_off}) {
    Bench bench({.new_board = true});
    SimulatedPerson person(bench);
    person.otherwise = [&](const commissioning::Question& question) {
      return question.topic == topic ? std::optional(commissioning::Answer{}) : std::nullopt;
    };
    Commissioning commissioning(bench, person);
    commissioning.run_all({"osmc 1", "relay 2"});
    EXPECT_EQ(person.movements, topic == commissioning::Topic::clear        ? 0
                                : topic == commissioning::Topic::supply_off ? 2
                                                                            : 1)
        << to_text(topic);
    expect_that_nothing_moved_unannounced(person);
  }
}

TEST(Commissioning, StopsWhenThePersonLetsGo) {
  for (const std::uint32_t after_ms : {0U, 30U, 200U, 400U}) {
    Bench bench({});
    SimulatedPerson person(bench);
    person.lets_go_after_ms = after_ms;
    Commissioning commissioning(bench, person);
    commissioning.run("osmc 1");
    EXPECT_EQ(person.movements, 3) << "the first movement was too short, so it was announced again";
    EXPECT_TRUE(findings_of(commissioning.report()).empty());
    expect_that_nothing_moved_unannounced(person);
  }
}

TEST(Commissioning, StopsWhenTheHandleIsReleasedOrTheLinkIsLost) {
  Bench bench({});
  SimulatedPerson person(bench);
  Commissioning commissioning(bench, person);
  int on_ms = 0;
  const auto look = bench.on_millisecond;
  std::function<void()> trouble = [&] { bench.happen("handle released"); };
  bench.on_millisecond = [&] {
    look();
    if (bench.model().pins().osmc[0].pwm != 0 && trouble) {
      std::exchange(trouble, nullptr)();
    }
  };
  commissioning.run("osmc 1");
  EXPECT_EQ(person.movements, 3) << "after the handle was held again";
  EXPECT_TRUE(findings_of(commissioning.report()).empty());

  trouble = [&] { bench.link_cut = true; };
  EXPECT_THROW(commissioning.run("osmc 1"), Error);
  bench.pass(2000);
  EXPECT_TRUE(bench.model().pins().is_safe()) << "by the board's timeout";
  bench.link_cut = false;
  bench.on_millisecond = [&] { on_ms += bench.model().pins().is_safe() ? 0 : 1; };
  bench.pass(5000);
  EXPECT_EQ(on_ms, 0) << "the outputs do not come back with the link";
}

TEST(Commissioning, AsksAgainIfTheBoardIsStoppedWhileThePersonReads) {
  Bench bench({});
  SimulatedPerson person(bench);
  person.before_key = [&] { bench.stop(); };
  int cleared = 0;
  person.otherwise = [&](const commissioning::Question& question) {
    cleared += question.topic == commissioning::Topic::clear ? 1 : 0;
    return std::nullopt;
  };
  Commissioning commissioning(bench, person);
  commissioning.run("relay 2");
  EXPECT_EQ(cleared, 1);
  EXPECT_EQ(person.movements, 2) << "announced again";
  expect_that_nothing_moved_unannounced(person);
}

TEST(Commissioning, BringsNothingBackAfterItStoodStillAndThePersonLetGo) {
  Bench bench({});
  SimulatedPerson person(bench);
  person.lets_go_after_ms = 200;
  person.hangs_ms = 3000;  // the board becomes safe because of the link, with its setpoints kept
  person.otherwise =
      [&](const commissioning::Question& question) -> std::optional<commissioning::Answer> {
    if (question.topic != commissioning::Topic::clear) return std::nullopt;
    return answer_of(commissioning::Answer::Kind::leave);
  };
  Commissioning commissioning(bench, person);
  EXPECT_EQ(commissioning.run("osmc 1"), Commissioning::End::left);
  int on_ms = 0;
  bench.on_millisecond = [&] { on_ms += bench.model().pins().is_safe() ? 0 : 1; };
  bench.pass(3000);
  EXPECT_EQ(on_ms, 0);
}

TEST(Commissioning, TakesNoEarlierPositionForAMovement) {
  Bench bench({});
  SimulatedPerson person(bench);
  bench.arm();
  bench.send(Command::stepper(1, Steps(-300), StepsPerSecond(2000)), Bench::Duration(1000));
  bench.model().turn_encoder(2, 5000);
  bench.pass(3000);
  Commissioning commissioning(bench, person);
  commissioning.run_all({"encoder 1", "stepper 1"});
  person.lets_go_after_ms = 100;
  commissioning.run("stepper 1");
  EXPECT_EQ(findings_of(commissioning.report()), std::vector<std::string>{});
}

TEST(Commissioning, AsksForTheSupplyAgainAfterMotorsHaveTurned) {
  Bench bench({});
  SimulatedPerson person(bench);
  int asked = 0;
  person.otherwise = [&](const commissioning::Question& question) {
    asked += question.topic == commissioning::Topic::supply_off ? 1 : 0;
    return std::nullopt;
  };
  Commissioning commissioning(bench, person);
  for (const char* check : {"relay 2", "encoder 1", "osmc 1", "encoder 1"})
    commissioning.run(check);
  EXPECT_EQ(asked, 2);
}

TEST(Commissioning, DoesNotJudgeABoardThatHasYetToUseItsWiring) {
  Bench bench({});
  SimulatedPerson person(bench);
  bench.give_wiring(wired({{"relay 2", "GPB4"}, {"relay 5", "GPB1"}}));
  Commissioning commissioning(bench, person);
  EXPECT_EQ(test::problem_of([&] { commissioning.run("relay 2"); }).kind, ErrorKind::usage);
  EXPECT_EQ(person.movements, 0);
}

TEST(Commissioning, OffersThePlanOnlyIfAnOutputWasSeenToAgreeAndNoCheckWasSkipped) {
  for (const auto& [seen, skips] : {std::pair{false, false}, {true, false}, {true, true}}) {
    Bench bench({.new_board = true});
    SimulatedPerson person(bench);
    int offered = 0;
    person.otherwise = [&](const commissioning::Question& question) {
      offered += question.topic == commissioning::Topic::give_wiring ? 1 : 0;
      return std::nullopt;
    };
    commissioning::Report begun;
    begun.wiring_source = "plan";
    begun.wiring = plan_wiring();
    for (const auto& check : commissioning::checks()) {
      begun.checks.push_back({check.id, commissioning::Status::skipped});
      if (!skips) begun.checks.back().note = "nothing is connected";
    }
    Commissioning commissioning(bench, person, begun);
    if (seen) commissioning.run("osmc 1");
    commissioning.offer();
    EXPECT_EQ(offered, seen && !skips ? 1 : 0);
  }
}

TEST(Commissioning, OffersNothingToAnotherBoard) {
  Bench bench({.wired = wired({{"relay 2", "GPB4"}, {"relay 5", "GPB1"}})});
  SimulatedPerson person(bench);
  Commissioning commissioning(bench, person);
  commissioning.run_all({"relay 2", "relay 5"});
  commissioning::Report of_another = commissioning.report();
  of_another.board_id = "sim-2";
  EXPECT_EQ(test::problem_of([&] { Commissioning(bench, person, of_another).offer(); }).kind,
            ErrorKind::usage);
}

TEST(Commissioning, SkipsASensorThatIsNotConnected) {
  Bench bench({});
  SimulatedPerson person(bench);
  person.otherwise = [](const commissioning::Question& question) {
    using commissioning::Topic;
    const bool sensor =
        question.topic == Topic::wheel_turned || question.topic == Topic::hand_before_sensor;
    return sensor ? std::optional(commissioning::Answer()) : std::nullopt;  // no
  };
  Commissioning commissioning(bench, person);
  commissioning.run_all({"encoder 2", "ultrasonic 3"});
  for (const auto& each : commissioning.report().checks) {
    EXPECT_EQ(each.status, commissioning::Status::skipped) << each.id;
    EXPECT_EQ(each.note, "nothing is connected") << each.id;
  }
  EXPECT_EQ(commissioning.report().checks.size(), 2U);
}

TEST(Commissioning, CanBeSkippedRepeatedLeftAndResumed) {
  Bench bench({});
  SimulatedPerson person(bench);
  int asked = 0;
  person.otherwise =
      [&](const commissioning::Question& question) -> std::optional<commissioning::Answer> {
    using Kind = commissioning::Answer::Kind;
    if (question.check == "encoder 1") return answer_of(Kind::skip);
    if (question.check == "encoder 2" && ++asked == 1) return answer_of(Kind::repeat);
    if (question.check == "encoder 3") return commissioning::Answer();  // it is not connected
    if (question.check == "ultrasonic 1") return answer_of(Kind::leave);
    return std::nullopt;
  };
  Commissioning commissioning(bench, person);
  EXPECT_EQ(commissioning.run_all(), Commissioning::End::left);
  EXPECT_EQ(asked, 2);
  EXPECT_EQ(commissioning.report().checks.back().id, "encoder 4");
  person.otherwise = nullptr;
  std::vector<std::string> done;
  Commissioning resumed(bench, person, commissioning.report());
  resumed.on_result = [&](const commissioning::CheckResult& result) { done.push_back(result.id); };
  EXPECT_EQ(resumed.run_all(), Commissioning::End::done);
  EXPECT_EQ(done.front(), "encoder 1");
  EXPECT_EQ(done.at(1), "ultrasonic 1");
  EXPECT_EQ(resumed.report().checks.size(), commissioning::checks().size());
}

TEST(Commissioning, SaysWhatTheBoardDoesNotSupport) {
  Bench bench({.papers_firmware = true});
  SimulatedPerson person(bench);
  Commissioning commissioning(bench, person);
  commissioning.run_all({"identity", "settings", "osmc 1"});
  const auto& checks = commissioning.report().checks;
  EXPECT_EQ(checks.at(0).status, commissioning::Status::unsupported);
  EXPECT_EQ(checks.at(0).note,
            "the board does not report its identity: it runs the paper's firmware");
  EXPECT_EQ(checks.at(1).status, commissioning::Status::unsupported);
  EXPECT_EQ(checks.at(2).status, commissioning::Status::passed);
  commissioning.offer();
  EXPECT_EQ(checks.size(), 3U) << "nothing can be given to it";
}

}  // namespace
}  // namespace r4::simulation
