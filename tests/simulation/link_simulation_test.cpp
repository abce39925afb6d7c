// SPDX-License-Identifier: GPL-3.0-or-later
// The promises of docs/design/safety-argument.md under random faults. R4_SCHEDULES sets the number
// of schedules (30,000 by default; tools/test sets it). A fifth of this number runs with
// standstills, and a tenth with several paths. The seeds start at R4_FIRST_SEED (1 by default), so
// that a long run can continue an earlier run. R4_SEED replays one schedule and prints its trace.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "environment.hpp"
#include "world.hpp"

namespace r4::simulation {
namespace {

std::string tail_of(const Report& report, std::size_t lines) {
  std::string text;
  const std::size_t from = report.trace.size() > lines ? report.trace.size() - lines : 0;
  for (std::size_t i = from; i < report.trace.size(); ++i) text += report.trace[i] + "\n";
  return text;
}

void add(Report& sum, const Report& report) {
  sum.executed += report.executed;
  sum.executed_groups += report.executed_groups;
  sum.groups_apart += report.groups_apart;
  sum.confirmed += report.confirmed;
  sum.refused += report.refused;
  sum.timed_out += report.timed_out;
  sum.link_losses += report.link_losses;
  sum.restores += report.restores;
  sum.stops += report.stops;
  sum.stops_confirmed += report.stops_confirmed;
  sum.clears += report.clears;
  sum.clears_refused += report.clears_refused;
  sum.farewells += report.farewells;
  sum.farewells_confirmed += report.farewells_confirmed;
  sum.busy += report.busy;
  sum.stale += report.stale;
  sum.duplicate += report.duplicate;
  sum.attacks += report.attacks;
  sum.rejected += report.rejected;
  sum.executed_signed += report.executed_signed;
  sum.strangers += report.strangers;
  sum.strangers_sessions += report.strangers_sessions;
  sum.strangers_executed += report.strangers_executed;
  sum.leases += report.leases;
  sum.watched += report.watched;
  sum.forged_leases += report.forged_leases;
  sum.sampled += report.sampled;
  sum.sampled_wrongly += report.sampled_wrongly;
  sum.standstills += report.standstills;
  sum.waited += report.waited;
  sum.waited_to_feed += report.waited_to_feed;
  sum.joins += report.joins;
  sum.path_losses += report.path_losses;
  sum.failovers += report.failovers;
  sum.timed_on_good += report.timed_on_good;
  sum.copies += report.copies;
  sum.replayed += report.replayed;
  sum.served_us += report.served_us;
  sum.worst_silence_us = std::max(sum.worst_silence_us, report.worst_silence_us);
}

// The number of schedules: R4_SCHEDULES or the default, divided by `part`. With 200 schedules or
// more, every event under test occurs.
std::uint64_t schedules_for(std::uint64_t part) {
  return std::max<std::uint64_t>(from_environment("R4_SCHEDULES", 30'000) / part, 200);
}

void replay(World::Beside beside) {
  const Report report = World(from_environment("R4_SEED", 0), true, beside).run();
  fmt::print("{}", tail_of(report, report.trace.size()));
  EXPECT_EQ(report.violation, "");
  EXPECT_EQ(report.sampled_wrongly, 0U);
}

// Runs this number of schedules. No promise may be broken.
Report run_all(std::uint64_t schedules, World::Beside beside) {
  const std::uint64_t first = from_environment("R4_FIRST_SEED", 1);
  std::atomic<std::uint64_t> next{first};
  std::mutex mutex;
  Report sum;
  std::vector<std::uint64_t> failing;
  auto work = [&] {
    Report mine;
    std::vector<std::uint64_t> mine_failing;
    for (std::uint64_t seed = next++; seed - first < schedules; seed = next++) {
      const Report report = World(seed, false, beside).run();
      add(mine, report);
      if (!report.violation.empty() || report.sampled_wrongly != 0) mine_failing.push_back(seed);
    }
    const std::lock_guard lock(mutex);
    add(sum, mine);
    failing.insert(failing.end(), mine_failing.begin(), mine_failing.end());
  };
  std::vector<std::thread> threads;
  for (unsigned i = 0; i < std::max(1U, std::thread::hardware_concurrency()); ++i) {
    threads.emplace_back(work);
  }
  for (std::thread& thread : threads) thread.join();

  fmt::print(
      "{} schedules: {} violations; {} commands executed ({} groups, {} went apart), {} confirmed, "
      "{} refused, {} "
      "timed out; "
      "{} links lost, {} outputs restored, {} stops obeyed, {} confirmed, {} cleared, {} clears "
      "refused; {} farewells obeyed, {} confirmed; answers {} BUSY, {} STALE, {} DUPLICATE; "
      "{} forged or replayed datagrams, {} rejected, {} signed commands executed; {} datagrams of "
      "strangers, {} sessions and {} commands of their own; {} leases, {} states watched, {} "
      "leases forged; {} samples timed, {} wrongly; "
      "{} standstills, {} datagrams waited, {} of them fed; longest silence to safe {:.1f} ms\n",
      schedules, failing.size(), sum.executed, sum.executed_groups, sum.groups_apart, sum.confirmed,
      sum.refused, sum.timed_out, sum.link_losses, sum.restores, sum.stops, sum.stops_confirmed,
      sum.clears, sum.clears_refused, sum.farewells, sum.farewells_confirmed, sum.busy, sum.stale,
      sum.duplicate, sum.attacks, sum.rejected, sum.executed_signed, sum.strangers,
      sum.strangers_sessions, sum.strangers_executed, sum.leases, sum.watched, sum.forged_leases,
      sum.sampled, sum.sampled_wrongly, sum.standstills, sum.waited, sum.waited_to_feed,
      static_cast<double>(sum.worst_silence_us) / 1000);
  std::sort(failing.begin(), failing.end());
  for (std::size_t i = 0; i < failing.size() && i < 20; ++i) {
    const Report report = World(failing[i], true, beside).run();
    const std::string wrong = fmt::format("{} samples timed wrongly", report.sampled_wrongly);
    ADD_FAILURE() << (report.violation.empty() ? wrong : report.violation)
                  << "\nreplay: R4_SEED=" << failing[i] << " with this test"
                  << (i < 3 ? "; the end of its trace:\n" + tail_of(report, 60) : "");
  }
  EXPECT_EQ(failing.size(), 0U);
  // The schedules must reach the events under test.
  EXPECT_GT(sum.executed, schedules);
  EXPECT_GT(sum.executed_groups, schedules / 2);
  EXPECT_LT(sum.groups_apart, sum.executed_groups / 100);
  EXPECT_GT(sum.restores, schedules / 100);
  EXPECT_GT(sum.stops_confirmed, schedules / 10);
  EXPECT_GT(sum.clears, schedules / 20);
  EXPECT_GT(sum.clears_refused, schedules / 100);
  EXPECT_GT(sum.farewells_confirmed, schedules / 20);
  EXPECT_GT(sum.stale, schedules / 100);
  EXPECT_GT(sum.duplicate, schedules / 100);
  EXPECT_GT(sum.busy, schedules / 100);
  EXPECT_GT(sum.attacks, schedules);
  EXPECT_GT(sum.rejected, sum.attacks * 9 / 10);
  EXPECT_GT(sum.executed_signed, schedules / 10);
  EXPECT_GT(sum.strangers, 5 * schedules);
  EXPECT_GT(sum.strangers_sessions, schedules / 100);
  // The event is rare, so a few hundred schedules only show that the event occurs.
  EXPECT_GT(sum.strangers_executed, schedules < 4000 ? 0 : schedules / 400);
  EXPECT_GT(sum.leases, schedules / 10);
  EXPECT_GT(sum.watched, schedules);
  EXPECT_GT(sum.forged_leases, schedules);
  EXPECT_GT(sum.sampled, schedules);
  EXPECT_EQ(sum.sampled_wrongly, 0U);
  return sum;
}

TEST(LinkSimulation, KeepsEveryPromiseUnderRandomFaults) {
  if (std::getenv("R4_SEED") != nullptr) return replay(World::Beside::nothing);
  run_all(schedules_for(1), World::Beside::nothing);
}

TEST(LinkSimulation, KeepsEveryPromiseDuringStandstillsOfTheBoard) {
  if (std::getenv("R4_SEED") != nullptr) return replay(World::Beside::standstills);
  const std::uint64_t schedules = schedules_for(5);
  const Report sum = run_all(schedules, World::Beside::standstills);
  EXPECT_GT(sum.standstills, schedules);
  EXPECT_GT(sum.waited_to_feed, schedules);
}

TEST(LinkSimulation, KeepsEveryPromiseOverSeveralPaths) {
  if (std::getenv("R4_SEED") != nullptr) return replay(World::Beside::paths);
  const std::uint64_t schedules = schedules_for(10);  // a schedule takes four times as long
  const Report sum = run_all(schedules, World::Beside::paths);
  fmt::print(
      "several paths: {} joined, {} lost while the session went on, {} failovers; {} copies at "
      "hosts; {} "
      "commands of {} ended beside a path that met the limits throughout, in {:.1f} h with one; {} "
      "datagrams of an hour ago\n",
      sum.joins, sum.path_losses, sum.failovers, sum.copies, sum.timed_on_good,
      sum.confirmed + sum.refused + sum.timed_out, static_cast<double>(sum.served_us) / 3.6e9,
      sum.replayed);
  EXPECT_GT(sum.joins, schedules);
  EXPECT_GT(sum.path_losses, schedules / 5);
  EXPECT_GT(sum.failovers, schedules / 50);
  EXPECT_GT(sum.timed_on_good, schedules);
  EXPECT_GT(sum.copies, 10 * schedules);
  EXPECT_GT(sum.replayed, schedules);
  EXPECT_GT(sum.served_us, schedules * 500'000);
}

TEST(LinkSimulation, KeepsEveryPromiseForSeedsThatOnceFailed) {
  // 415: a lagging path's last BUSY must not delay other paths longer than their own BUSY.
  // 18012: a BUSY from before a path joined must not hold commands back.
  // 98796, 103256: before the session's first heartbeat, a path's answer is from before a restart
  // that another path shows.
  // 104104, 115880: a path reports late that the board boots. Other paths have reported the boot
  // earlier, and nothing since.
  // 271382, 446043: as 104104, but the other paths are silent.
  // 756480: if a state from before a farewell has the millisecond of a heartbeat, the heartbeat
  // must not confirm the farewell.
  for (const std::uint64_t seed :
       {415U, 18012U, 98796U, 103256U, 104104U, 115880U, 271382U, 446043U, 756480U}) {
    EXPECT_EQ(World(seed, false, World::Beside::paths).run().violation, "") << "seed " << seed;
  }
}

TEST(LinkSimulation, TheSameSeedGivesTheSameTrace) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const Report first = World(seed, true).run();
    const Report second = World(seed, true).run();
    ASSERT_EQ(first.trace, second.trace) << "seed " << seed;
    ASSERT_EQ(first.trace_hash, World(seed, false).run().trace_hash) << "seed " << seed;
    for (const World::Beside beside : {World::Beside::standstills, World::Beside::paths}) {
      ASSERT_EQ(World(seed, true, beside).run().trace, World(seed, true, beside).run().trace);
    }
  }
}

TEST(LinkSimulation, TripsFalselyLessThanOnceADayAtTenPercentLoss) {
  Schedule day;
  day.duration_us = 24ULL * 3600 * 1'000'000;
  day.settings.state_rate_hz = 1;
  day.to_board.loss = day.to_host.loss = 0.1;
  day.command_interval_us = 3'600'000'000U;
  day.board_drift_ppm = Schedule::most_drift_ppm;  // the host has less time
  const Report report = World(1, day, false).run();
  fmt::print("false trips in a day at 10 % loss: {}\n", report.link_losses);
  EXPECT_EQ(report.violation, "");
  EXPECT_EQ(report.link_losses, 0U);
}

}  // namespace
}  // namespace r4::simulation
