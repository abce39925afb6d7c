// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/commissioning/report.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "r4link/commissioning/commissioning.hpp"
#include "r4link/error.hpp"
#include "r4link/wiring/wiring_file.hpp"
#include "tests/simulation/random.hpp"
#include "tests/support/problems.hpp"

namespace r4::commissioning {
namespace {

Report some_report() {
  Report report;
  report.begun = "2026-11-29 14:00 UTC";
  report.software = "0.2.0";
  report.url = "serial:///tmp/<b>\"R4\\&\x1b[31m\xff</b>";
  report.board_id = "sim-1";
  report.firmware = "0.2.0";
  report.wiring_source = "given";
  CheckResult motor{"osmc 1", Status::found, "a note\nof two lines"};
  motor.measured = {{"encoder 1, forward", 116, "counts"}, {"share", 0.25, "%"}};
  motor.found = {{Finding::exchanged, "osmc 1", "osmc 2 instead"},
                 {Finding::reversed, "osmc 1", ""}};
  motor.learnt = {
      {Learnt::What::serves, signal_named("osmc 1 pwm"), signal_named("osmc 2 pwm"), {}, 1},
      {Learnt::What::option, signal_named("osmc 1 direction"), 0, {}, 1},
      {Learnt::What::place, signal_named("handle"), 0, Place{44 | Place::option_bit}, 1},
      {Learnt::What::full_scale, signal_named("analog 1"), 0, {}, 1.033}};
  report.checks = {
      {"identity", Status::passed}, motor, {"osmc 2", Status::skipped, "nothing is connected"}};
  return report;
}

TEST(CommissioningReport, IsReadBackAsItWasWritten) {
  const std::string json = write_json(some_report());
  const Report read = read_report(json, "robot.json");
  EXPECT_EQ(write_json(read), json);
  EXPECT_EQ(write_wiring(learnt_wiring(read)), write_wiring(learnt_wiring(some_report())));
  EXPECT_EQ(read.checks.at(1).learnt.size(), 4U);
  EXPECT_EQ(read.found().size(), 2U);
}

TEST(CommissioningReport, LearnsTheWiringOfExchangedThings) {
  const Wiring learnt = learnt_wiring(some_report());
  const auto place = [&](const char* signal) {
    const int index = signal_named(signal);
    return place_name(index, learnt.places[index]);
  };
  EXPECT_EQ(place("osmc 2 pwm"), "osmc.0");
  EXPECT_EQ(place("osmc 2 direction"), "osmc.1 inverted");
  EXPECT_EQ(place("handle"), "D44 low");
  EXPECT_EQ(check(learnt).fault, WiringFault::twice) << "osmc 2 was not checked";
}

TEST(CommissioningReport, ShowsForeignTextHarmlessly) {
  const std::string html = write_html(some_report());
  EXPECT_NE(html.find("/tmp/&lt;b&gt;&quot;R4"), std::string::npos);
  EXPECT_EQ(html.find("<b>"), std::string::npos);
  for (const std::string& text : {html, write_json(some_report())}) {
    EXPECT_EQ(text.find('\x1b'), std::string::npos);
    EXPECT_EQ(text.find('\xff'), std::string::npos);
  }
  EXPECT_NE(html.find("osmc 2 instead"), std::string::npos);
  EXPECT_NE(html.find("not reached"), std::string::npos);
}

TEST(CommissioningReport, RefusesWhatIsNotAReport) {
  const std::string good = write_json(some_report());
  const auto without = [&](const std::string& part, const std::string& other) {
    std::string text = good;
    return text.replace(text.find(part), part.size(), other);
  };
  const std::string deep(100'000, '[');
  for (const std::string& text :
       {std::string(), std::string("{}"), std::string("[1, 2"),
        std::string(R"({"r4_commissioning": 2})"), deep, std::string(max_report_text + 1, ' '),
        good + "x", without("\"exchanged\"", "\"moved\""), without("\"passed\"", "\"good\""),
        without("\"serves\"", "\"steals\""), without("\"osmc 1 pwm\"", "\"osmc 9 pwm\""),
        without("1.033", "-1"), without("\"analog 1\"", "\"handle\""),
        without("\"osmc 2 pwm\"", "\"relay 1\""), without("1.033", "1e999"),
        without("r4-wiring 1", "r4-wiring 2")}) {
    const Problem problem = test::problem_of([&] { read_report(text, "bad.json"); });
    EXPECT_EQ(problem.kind, ErrorKind::data) << text.substr(0, 80);
    EXPECT_FALSE(problem.fix.empty());
  }
}

TEST(CommissioningReport, NeverCrashesOnDamagedText) {
  const std::string good = write_json(some_report());
  simulation::Random random(5);
  for (int i = 0; i < 2000; ++i) {
    std::string text = good.substr(0, random.below(good.size()));
    for (int k = 0; k < 3 && !text.empty(); ++k) {
      text[random.below(text.size())] = static_cast<char>(random.below(256));
    }
    try {
      write_html(read_report(text, "damaged"));
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::data);
    }
  }
}

TEST(CommissioningFinding, HasANameOfItsOwn) {
  for (int i = 0; i < static_cast<int>(Finding::count); ++i) {
    const auto finding = static_cast<Finding>(i);
    EXPECT_EQ(finding_named(text_of(finding).name), finding);
    EXPECT_FALSE(text_of(finding).wrong.empty() || text_of(finding).fix.empty());
  }
  EXPECT_EQ(finding_named("nothing"), Finding::count);
}

TEST(CommissioningCheck, SaysWhatMovesIfTheWheelsMustBeOffTheGround) {
  for (const Check& check : checks()) {
    EXPECT_EQ(&check_named(check.id), &check);
    EXPECT_TRUE(check.section == Section::supply_off || !check.moves.empty()) << check.id;
  }
  EXPECT_EQ(test::problem_of([] { check_named("osmc 9"); }).kind, ErrorKind::usage);
}

}  // namespace
}  // namespace r4::commissioning
