// SPDX-License-Identifier: GPL-3.0-or-later
// The promises of docs/design/safety-argument.md with every combination of few faults in short
// stories. R4_FAULTS sets the highest number of faults at once. If R4_SCHEDULES (30,000 by default)
// is at least 100,000, or at least 10,000 for a story with few schedules, the default is 2.
// Otherwise the default is 1. R4_STORY and R4_STORY_FAULTS repeat one schedule and print its trace.
#include "search.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <string>
#include <string_view>

#include "play.hpp"
#include "tests/simulation/environment.hpp"

namespace r4::simulation {
namespace {

int most_faults(const Story& story) {
  const std::uint64_t schedules = from_environment("R4_SCHEDULES", 30'000);
  const std::uint64_t pairs_from = story.is_short ? 10'000 : 100'000;
  return static_cast<int>(from_environment("R4_FAULTS", schedules >= pairs_from ? 2 : 1));
}

class EveryFault : public testing::TestWithParam<Story> {};

TEST_P(EveryFault, KeepsEveryPromise) {
  const Story& story = GetParam();
  const int most = most_faults(story);
  const Search found = search(story, most);
  fmt::print("{}: {} datagrams; schedules:", story.name, found.steps);
  for (std::size_t i = 0; i < found.schedules.size(); ++i) {
    fmt::print(" {} with {} fault{},", found.schedules[i], i, i == 1 ? "" : "s");
  }
  fmt::print(" {} broke a promise\n", found.findings.size());
  for (const auto& [what, kind] : kinds_of(found.findings)) {
    ADD_FAILURE() << fmt::format("{}: {} schedules. The first:\n", what, kind.schedules)
                  << tell(story, kind.first);
  }
}

std::string name_of_case(const testing::TestParamInfo<Story>& info) {
  std::string name = info.param.name;
  std::replace(name.begin(), name.end(), ' ', '_');
  return name;
}
INSTANTIATE_TEST_SUITE_P(Stories, EveryFault, testing::ValuesIn(stories()), name_of_case);

TEST(EveryFaultOfAStory, CanBeReplayedByName) {
  const char* const name = std::getenv("R4_STORY");
  const char* const faults = std::getenv("R4_STORY_FAULTS");
  bool any = false;
  for (const Story& story : stories()) {
    if (story.name != std::string_view(name == nullptr ? "drive" : name)) continue;
    any = true;
    const std::vector<Fault> list = faults_from(faults == nullptr ? "7:lost 9:overtaken" : faults);
    Play play(story, list, true);
    const Report report = play.run();
    EXPECT_EQ(report.violation, "");
    EXPECT_EQ(faults_from(to_text(list)), list);
    EXPECT_EQ(Play(story, list, true).run().trace, report.trace);
    if (name == nullptr) break;
    for (const std::string& line : report.trace) fmt::print("{}\n", line);
    fmt::print("{}", tell(story, {list, report.violation}));
  }
  EXPECT_TRUE(any) << name << " is not the name of a story";
}

}  // namespace
}  // namespace r4::simulation
