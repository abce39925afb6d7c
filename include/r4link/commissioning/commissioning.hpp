// SPDX-License-Identifier: GPL-3.0-or-later
// Checks a board step by step with a person, in the order of the paper's sections 7.3 to 8.5, and
// learns its wiring (docs/how-to/commissioning.md):
//     r4::Board board("serial:auto");
//     r4::commissioning::BoardOnLink tested(board);
//     r4::commissioning::Commissioning commissioning(tested, person);
//     commissioning.run_all();
//     commissioning.offer();                              // the learnt wiring and settings
//     write_html(commissioning.report());
//
// Safety. Each movement is announced, and begins only when the person holds the key. One output at
// a time moves, for half a second or as announced, a motor at a tenth of full duty. Then, or when
// the person releases the key, the setpoint becomes 0, and relay 1 opens. After a failure (link,
// exception, supervision), the board is stopped, or goes safe because the heartbeats end.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "../config.hpp"
#include "board_under_test.hpp"
#include "person.hpp"
#include "report.hpp"

namespace r4::commissioning {

enum class Section : std::uint8_t { supply_off, wheels_off_ground };
// "motor supply off", "wheels off the ground".
R4LINK_API const char* to_text(Section section);

struct Check {
  std::string id;  // "osmc 1", "supply AIN24", "silence"
  Section section;
  std::string_view moves;  // the moving part; empty: no movement
  std::string_view about;  // one sentence
  int row;                 // index in the table of host/commissioning/checks.cpp
  int channel;             // from 1; 1 also for a thing without channels
};
R4LINK_API const std::vector<Check>& checks();
// Throws Error{usage} if there is no such check.
R4LINK_API const Check& check_named(std::string_view id);

class R4LINK_API Commissioning {
 public:
  // Continues `begun`. If `begun` is a report of another board, run() throws Error{usage}. `board`
  // and `person` must outlive the Commissioning.
  Commissioning(BoardUnderTest& board, Person& person, Report begun = {});

  // Does a check, also a second time, and puts the result into the report. If the link is lost,
  // throws Error: the report is kept, and the board must be opened again.
  enum class End : std::uint8_t { done, left };
  End run(std::string_view id);
  // Does all checks that are neither passed nor found, or the checks in `only` in any case.
  End run_all(const std::vector<std::string>& only = {});
  // Asks whether the board may keep the learnt wiring and settings, sends and verifies them.
  End offer();

  const Report& report() const { return report_; }
  // Called after each check.
  std::function<void(const CheckResult&)> on_result;

 private:
  R4LINK_PRIVATE CheckResult& result_of(const Check& check);
  R4LINK_PRIVATE std::optional<Answer::Kind> carry_out(CheckResult& result,
                                                       const std::function<void()>& work);
  R4LINK_PRIVATE End run(const Check& check);

  BoardUnderTest& board_;
  Person& person_;
  Report report_;
  bool identified_ = false;
  bool ready_[2] = {};  // the person has confirmed the start of the section
};

}  // namespace r4::commissioning
