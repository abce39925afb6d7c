// SPDX-License-Identifier: GPL-3.0-or-later
// Every combination of few faults in a story, each combination in a separate run.
//
// The second fault happens at a step of the run with the first fault, and later faults likewise.
// Faults are in the order of their steps, and of their kinds at the same step. A datagram has at
// most one fault. A schedule that breaks a promise gets no further faults. Therefore the search is
// finite, and complete for these kinds of faults.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "story.hpp"

namespace r4::simulation {

struct Finding {
  std::vector<Fault> faults;
  std::string violation;
};

struct Search {
  std::size_t steps = 0;                 // datagrams of the story without faults
  std::vector<std::uint64_t> schedules;  // schedules with no fault, one fault, two faults, …
  std::vector<Finding> findings;         // in the order of the search
};

// Uses all processors.
Search search(const Story& story, int most_faults);

// Describes a schedule in plain words: its events and faults, the broken promise, and the command
// that repeats the schedule.
std::string tell(const Story& story, const Finding& finding);
// The broken promise and the kinds of faults that break it, for example "joined: stranger-joins".
// If strangers take part, only their faults are listed. If fewer faults of the same kinds break the
// same promise, the kind is omitted. Holds the number of schedules and the first schedule.
struct FoundKind {
  std::size_t schedules = 0;
  Finding first;
};
std::map<std::string, FoundKind> kinds_of(const std::vector<Finding>& findings);

}  // namespace r4::simulation
