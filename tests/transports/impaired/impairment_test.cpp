// SPDX-License-Identifier: GPL-3.0-or-later
// A transport that disturbs datagrams on purpose: its effects in virtual time, and as a carrier.
#include "transports/impaired/impairment.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>
#include <string>
#include <vector>

#include "../recorder.hpp"
#include "tests/support/problems.hpp"
#include "transports/impaired/impaired_carrier.hpp"
#include "transports/memory_carrier.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

struct OnItsWay {
  Time at;
  std::string bytes;
  bool operator==(const OnItsWay&) const = default;
};

// Sends a datagram of 20 bytes every millisecond. Returns the datagrams that arrive, with their
// times.
std::vector<OnItsWay> arrivals(const std::string& how, int count, ImpairmentCounters& counters,
                               std::uint64_t stream = 1) {
  ImpairedDirection direction(Impairment::parse(how), stream, 0ms);
  std::vector<OnItsWay> all;
  const auto take = [&](Time until) {
    while (direction.due() && *direction.due() <= until) {
      const Time at = *direction.due();
      all.push_back({at, direction.take(until)->bytes});
    }
  };
  for (int i = 0; i < count; ++i) {
    const Time now = i * 1ms;
    take(now);
    std::string bytes = std::to_string(i);
    bytes.resize(20, '.');
    direction.put(now, {bytes, 0, 0});
  }
  take(10h);
  counters = direction.counters();
  return all;
}

TEST(Impairment, HasTheStatedEffectsAndRepeatsThemForTheSameSeed) {
  ImpairmentCounters counters;
  const std::string how = "loss=5%,delay=20ms±10,duplicate=1%,corrupt=2%,seed=7";
  const std::vector<OnItsWay> all = arrivals(how, 100'000, counters);
  EXPECT_NEAR(static_cast<double>(counters.lost), 5000, 300);
  EXPECT_NEAR(static_cast<double>(counters.duplicated), 950, 150);
  EXPECT_NEAR(static_cast<double>(counters.corrupted), 1900, 200);
  EXPECT_EQ(counters.passed, 100'000 - counters.lost + counters.duplicated);
  EXPECT_EQ(counters.passed, all.size());
  Time least = 1h;
  Time most = 0ms;
  int overtaken = 0;
  int last = 0;
  for (const OnItsWay& each : all) {
    int number = 0;
    if (std::sscanf(each.bytes.c_str(), "%d.", &number) != 1 || number > 100'000) continue;
    if (each.bytes.find_first_not_of("0123456789.") != std::string::npos) continue;
    if (std::to_string(number) + std::string(20 - std::to_string(number).size(), '.') !=
        each.bytes) {
      continue;  // damaged
    }
    // The number is damaged.
    if (each.at < number * 1ms + 10ms || each.at > number * 1ms + 30ms) continue;
    least = std::min(least, each.at - number * 1ms);
    most = std::max(most, each.at - number * 1ms);
    overtaken += number < last ? 1 : 0;
    last = number;
  }
  EXPECT_LT(least, 11ms);
  EXPECT_GT(most, 29ms);
  EXPECT_GT(overtaken, 1000);
  EXPECT_EQ(arrivals(how, 1000, counters), arrivals(how, 1000, counters));
  EXPECT_NE(arrivals(how, 1000, counters), arrivals(how, 1000, counters, 2));
  EXPECT_NE(arrivals(how, 1000, counters),
            arrivals("loss=5%,delay=20ms±10,seed=8", 1000, counters));
}

TEST(Impairment, WithoutEffectsPassesEverythingAtOnce) {
  ImpairmentCounters counters;
  const std::vector<OnItsWay> all = arrivals("seed=3", 1000, counters);
  ASSERT_EQ(all.size(), 1000U);
  EXPECT_EQ(all[500].at, 500ms);
}

TEST(Impairment, CutsTheLinkForAWhile) {
  ImpairmentCounters counters;
  const std::vector<OnItsWay> all = arrivals("cut=0.1s+0.2s", 1000, counters);
  EXPECT_EQ(counters.cut, 200U);
  EXPECT_EQ(all[99].at, 99ms);
  EXPECT_EQ(all[100].at, 300ms);
}

TEST(Impairment, DropsDatagramsAboveItsLimit) {
  ImpairedDirection direction(Impairment::parse("delay=3600s"), 1, 0ms);
  for (int i = 0; i < 10'000; ++i) direction.put(0ms, {"x", 0, 0});
  EXPECT_EQ(direction.counters().overflow, 10'000 - ImpairedDirection::most_on_their_way);
  EXPECT_FALSE(direction.take(3599s));
  EXPECT_TRUE(direction.take(3600s));
}

TEST(Impairment, RefusesInvalidText) {
  std::istringstream words(
      ", loss loss= loss=5 loss=101% loss=-1% loss=nan% loss=5%% delay=x delay=10ms±20 delay=5± "
      "delay=1e9s delay=10msec cut=5s cut=+2s cut=1s+2s+3s seed=-1 seed=1.5 seed= speed=1 loss=5%, "
      "loss=5%,,seed=1 Loss=5%");
  std::vector<std::string> refused{""};
  for (std::string word; words >> word;) refused.push_back(word);
  for (const std::string& wrong : refused) {
    const Problem problem = problem_of([&] { Impairment::parse(wrong); });
    EXPECT_EQ(problem.kind, ErrorKind::usage) << wrong;
    EXPECT_TRUE(contains(problem.fix, "loss=5%")) << wrong;
  }
  const Impairment link = Impairment::parse("delay=1.5+-0.5,cut=2+1");
  EXPECT_EQ(link.delay, 1500us);
  EXPECT_EQ(link.jitter, 500us);
  EXPECT_EQ(link.cut_at, 2s);
  EXPECT_EQ(link.cut_for, 1s);
}

TEST(ImpairedCarrier, DelaysAndLosesDatagrams) {
  asio::io_context io;
  auto [a, b] = make_memory_pair(io);
  const auto slow =
      make_impaired_carrier(io, std::move(a), Impairment::parse("delay=20ms,loss=50%"));
  Recorder at_slow, at_b;
  slow->open(at_slow);
  b->open(at_b);
  ASSERT_TRUE(run_until(io, [&] { return slow->up(); }));
  const auto begin = Clock::now();
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ(slow->send("there", Priority::normal), SendResult::sent);
    b->send("back", Priority::normal);
  }
  const auto all = [](const ImpairmentCounters& counters) {
    return counters.passed + counters.lost;
  };
  EXPECT_TRUE(
      run_until(io, [&] { return all(slow->sent()) == 100 && all(slow->received()) == 100; }));
  EXPECT_GE(Clock::now() - begin, 20ms);
  EXPECT_EQ(at_slow.datagrams.size(), slow->received().passed);
  EXPECT_TRUE(run_until(io, [&] { return at_b.datagrams.size() == slow->sent().passed; }));
  EXPECT_NE(slow->sent().lost, 0U);
  EXPECT_NE(slow->sent().passed, 0U);
  slow->send("never", Priority::normal);
  slow->close();
  run_for(io, 30ms);
  EXPECT_EQ(at_b.count(Kind::down), 1U);
  EXPECT_FALSE(at_b.has("never"));
}

}  // namespace
}  // namespace r4::test
