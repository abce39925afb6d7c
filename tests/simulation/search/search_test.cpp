// SPDX-License-Identifier: GPL-3.0-or-later
// The promises of docs/safety.md under every combination of few faults in short stories. R4_FAULTS
// sets how many faults at once: 2 by default where R4_SCHEDULES asks for 100,000 schedules or more
// of the random simulator, else 1, and 2 in the stories that take little time. R4_STORY and
// R4_STORY_FAULTS run one schedule again and print its trace.
#include "search.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <set>
#include <string>
#include <string_view>

#include "play.hpp"
#include "tests/simulation/environment.hpp"

namespace r4::simulation {
namespace {

// What is known to break a promise, by story. It has to be found: a line that is not found any more
// goes.
struct Known {
  std::string_view story;
  std::string_view what;
};
constexpr Known found_today[] = {
    // A stranger who watches guesses a heartbeat of the host, and his address becomes a path of the
    // session.
    {"drive", "joined: stranger-beats"},
    {"drive", "joined: stranger-joins"},
    {"killed", "joined: stranger-beats"},
    {"killed", "joined: stranger-joins"},
    {"restart", "joined: stranger-beats"},
    {"restart", "joined: stranger-joins"},
    {"farewell", "joined: stranger-beats"},
    {"farewell", "joined: stranger-joins"},
    {"farewell", "joined: stranger-inherits"},
    {"waiting", "joined: stranger-beats"},
    {"waiting", "joined: stranger-joins"},
    {"watched", "joined: stranger-beats"},
    {"watched", "joined: stranger-joins"},
    {"two paths", "joined: stranger-beats"},
    {"two paths", "joined: stranger-elsewhere"},
    {"two paths", "joined: stranger-joins"},
    {"cable", "joined: stranger-beats"},
    {"cable", "joined: stranger-elsewhere"},
    {"cable", "joined: stranger-joins"},
    {"reboot", "joined: stranger-beats"},
    {"reboot", "joined: stranger-joins"},
    {"sleep", "joined: stranger-beats"},
    {"sleep", "joined: stranger-joins"},
    // Who gets the address of a host that was killed keeps its session, or resumes it.
    {"killed", "joined: stranger-inherits"},
    {"restart", "joined: stranger-inherits"},
    {"waiting", "joined: stranger-inherits"},
    {"waiting", "resumed: stranger-inherits"},
    {"watched", "joined: stranger-inherits"},
    {"cable", "joined: stranger-inherits"},
    {"bridge", "joined: stranger-inherits"},
    {"bridge for two", "joined: stranger-inherits"},
    {"bridge for two", "resumed: stranger-inherits"},
    // So does a stranger at the bridge over which the host had its board.
    {"bridge", "resumed: stranger-joins"},
    {"bridge for two", "resumed: stranger-beats"},
    {"bridge for two", "resumed: stranger-joins"},
    // A signed heartbeat that is sent again at once makes that address a path of the session.
    {"key", "joined: stranger-copies"},
};

int faults_in(std::string_view what) {
  return static_cast<int>(std::count(what.begin(), what.end(), ' '));
}

int most_faults() {
  const bool nightly = from_environment("R4_SCHEDULES", 0) >= 100'000;
  return static_cast<int>(from_environment("R4_FAULTS", nightly ? 2 : 1));
}

class EveryFault : public testing::TestWithParam<Story> {};

TEST_P(EveryFault, KeepsEveryPromise) {
  const Story& story = GetParam();
  const int most = most_faults();
  const Search found = search(story, most);
  fmt::print("{}: {} datagrams; schedules:", story.name, found.steps);
  for (std::size_t i = 0; i < found.schedules.size(); ++i) {
    fmt::print(" {} with {} fault{},", found.schedules[i], i, i == 1 ? "" : "s");
  }
  fmt::print(" {} broke a promise\n", found.findings.size());
  std::set<std::string_view> known;
  for (const Known& each : found_today) {
    if (each.story == story.name && faults_in(each.what) <= most) known.insert(each.what);
  }
  for (const auto& [what, kind] : kinds_of(found.findings)) {
    if (known.erase(what) != 0) continue;
    ADD_FAILURE() << what << " (" << kind.schedules << " schedules). The first:\n"
                  << tell(story, kind.first);
  }
  for (const std::string_view what : known) {
    ADD_FAILURE() << "not found any more, so it has to go from found_today: " << what;
  }
}

std::string name_of_case(const testing::TestParamInfo<Story>& info) {
  std::string name = info.param.name;
  std::replace(name.begin(), name.end(), ' ', '_');
  return name;
}
INSTANTIATE_TEST_SUITE_P(Stories, EveryFault, testing::ValuesIn(stories()), name_of_case);

TEST(EveryFaultOfAStory, IsRunAgainByItsName) {
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
