// SPDX-License-Identifier: GPL-3.0-or-later
// Every combination of few faults in a story, each a run of its own.
//
// The second fault happens at a step of the run with the first, and so on: faults come in the order
// of their steps, and of their kinds where they happen at the same step. A datagram has one fault
// of its own at most. A schedule that breaks a promise gets no further faults. So what is searched
// is finite, and complete for these kinds.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "story.hpp"

namespace r4::simulation {

// A schedule that breaks a promise.
struct Finding {
  std::vector<Fault> faults;
  std::string violation;
};

struct Search {
  std::size_t steps = 0;                 // of the story without faults
  std::vector<std::uint64_t> schedules;  // with no fault, one, two, …
  std::vector<Finding> findings;         // in order
};

// On all processors.
Search search(const Story& story, int most_faults);

// The story of a schedule: what happens in it, the faults in plain words, what breaks, and how to
// run it again.
std::string tell(const Story& story, const Finding& finding);
// What is broken and by which kinds of faults, of strangers alone if they have a part in it:
// "joined: stranger-joins"; with how many schedules that is, and the first of them. Without those
// to which fewer faults of a part of these kinds lead already.
struct FoundKind {
  std::size_t schedules = 0;
  Finding first;
};
std::map<std::string, FoundKind> kinds_of(const std::vector<Finding>& findings);

}  // namespace r4::simulation
