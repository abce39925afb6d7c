// SPDX-License-Identifier: GPL-3.0-or-later
// The report of a commissioning: what was checked, measured, found, learnt and left out. As JSON it
// is also what a later run resumes from; as HTML it is one file for people.
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
  not_done,  // `note` says why, if it was tried
  passed,
  found,        // something is wrong
  skipped,      // by the person
  unsupported,  // this board or transport cannot do it: `note`
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

// A change of the wiring or of a setting that would agree with what was seen. The board was not
// given it yet.
struct Learnt {
  enum class What : std::uint8_t {
    serves,      // the places of `signal` serve the thing of `other`
    option,      // the option of `signal` is the other one
    place,       // `signal` is at `place`
    full_scale,  // of the analog input `signal`: `factor` times the present one
  };
  What what = What::serves;
  int signal = 0;  // index in Wiring; of a thing with several signals the first
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
  std::string begun;     // time of day, as the program that began it writes it
  std::string software;  // version of R4 link on the host
  std::string url;
  std::string board_id, board_name, firmware, capabilities;
  std::string wiring_source;        // "plan", "given", "damaged"; empty: unknown
  Wiring wiring = plan_wiring();    // that the board keeps; if unknown, the plan
  std::vector<CheckResult> checks;  // in the order of the table

  // Everything that was found.
  R4LINK_API std::vector<Found> found() const;
};

// The report's wiring with all that was learnt. Of things that were exchanged, all must have been
// checked: otherwise a place serves two signals, and check() says so.
R4LINK_API Wiring learnt_wiring(const Report& report);

R4LINK_API std::string write_json(const Report& report);
constexpr std::size_t max_report_text = 1024 * 1024;  // bytes
// `name` is that of the file, for errors. Throws Error{data}.
R4LINK_API Report read_report(std::string_view json, const std::string& name);
// Also throws Error{open} or Error{permission}.
R4LINK_API Report load_report(const std::string& path);

R4LINK_API std::string write_html(const Report& report);

}  // namespace r4::commissioning
