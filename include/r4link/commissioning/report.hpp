// SPDX-License-Identifier: GPL-3.0-or-later
// The report of a commissioning: checks, measurements, findings, learnt changes and omissions. A
// later run can resume from the JSON form. The HTML form is one file for people.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "../config.hpp"
#include "../wiring/wiring.hpp"
#include "findings.hpp"

namespace r4::commissioning {

enum class Status : std::uint8_t {
  not_done,  // `note`: why, if it was tried
  passed,
  found,        // the check has found a fault
  skipped,      // by the person
  unsupported,  // this board or transport does not support the check: `note`
};
// "not done", "passed", "found", "skipped", "unsupported".
R4LINK_API const char* to_text(Status status);

struct Measured {
  std::string what;
  double value = 0;
  std::string unit;
};

struct Found {
  Finding finding = Finding::count;
  std::string thing;   // "osmc 1"
  std::string detail;  // "osmc 2 moved"; may be empty
};

// A change of the wiring or of a setting that agrees with the observations, for the board to keep.
struct Learnt {
  enum class What : std::uint8_t {
    serves,      // the places of `signal` belong to the thing of `other`
    option,      // the option of `signal` has the other value
    place,       // `signal` is at `place`
    full_scale,  // the full scale of input `signal` becomes `factor` times the present full scale
  };
  What what = What::serves;
  int signal = 0;  // index in Wiring; for a thing with several signals, the first
  int other = 0;
  Place place;
  double factor = 1;
};

struct CheckResult {
  std::string id;
  Status status = Status::not_done;
  std::string note{};
  std::vector<Measured> measured{};
  std::vector<Found> found{};
  std::vector<Learnt> learnt{};
};

struct Report {
  std::string begun;     // time of day, in the form of the program that began the report
  std::string software;  // version of R4 link on the host
  std::string url;
  std::string board_id, board_name, firmware, capabilities;
  std::string wiring_source;        // "plan", "given", "damaged"; empty: unknown
  Wiring wiring = plan_wiring();    // the wiring that the board keeps; if unknown, the plan
  std::vector<CheckResult> checks;  // in the order of checks()

  // The findings of all checks.
  R4LINK_API std::vector<Found> found() const;
};

// The report's wiring with all learnt changes. If two things were exchanged, the report needs the
// checks of both things: otherwise a place serves two signals, and check() reports a fault.
R4LINK_API Wiring learnt_wiring(const Report& report);

R4LINK_API std::string write_json(const Report& report);
constexpr std::size_t max_report_text = 1024 * 1024;  // bytes
// `name`: the file's name, for errors. Throws Error{data}.
R4LINK_API Report read_report(std::string_view json, const std::string& name);
// Also throws Error{open} or Error{permission}.
R4LINK_API Report load_report(const std::string& path);

R4LINK_API std::string write_html(const Report& report);

}  // namespace r4::commissioning
