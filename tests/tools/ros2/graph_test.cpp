// SPDX-License-Identifier: GPL-3.0-or-later
// The parts of the graph that do not need DDS: names, environment, releases, delays, the outbox.
#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <map>

#include "r4link/error.hpp"
#include "tools/r4/ros2/domain/environment.hpp"
#include "tools/r4/ros2/graph/names.hpp"
#include "tools/r4/ros2/graph/node_listing.hpp"
#include "tools/r4/ros2/graph/outbox.hpp"
#include "tools/r4/ros2/graph/transit.hpp"

namespace r4::tool::ros2 {
namespace {

using namespace std::chrono_literals;

Domain with_variables(std::map<std::string, std::string> variables) {
  return domain_of([&variables](const char* name) { return variables[name]; });
}

TEST(Ros2Environment, StaysOnThisComputerByDefault) {
  const Domain usual = with_variables({});
  EXPECT_EQ(usual.id, 0U);
  EXPECT_EQ(usual.reach, "this computer");
  EXPECT_TRUE(usual.one_computer);
  EXPECT_NE(usual.configuration.find("name=\"lo\""), std::string::npos);
  EXPECT_EQ(
      with_variables({{"ROS_LOCALHOST_ONLY", "1"}, {"ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET"}})
          .configuration,
      usual.configuration);
  EXPECT_EQ(with_variables({{"ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST"}}).configuration,
            usual.configuration);
  for (const auto& each : {with_variables({{"ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET"}}),
                           with_variables({{"ROS_LOCALHOST_ONLY", "0"}})}) {
    EXPECT_EQ(each.reach, "the network");
    EXPECT_FALSE(each.one_computer);
    EXPECT_EQ(each.configuration.find("name=\"lo\""), std::string::npos);
  }
  EXPECT_EQ(with_variables({{"ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF"}}).reach, "nobody");
}

TEST(Ros2Environment, AcceptsPeersADomainAndACycloneConfiguration) {
  const Domain peers = with_variables({{"ROS_STATIC_PEERS", "10.0.0.7;robot.local;"}});
  EXPECT_EQ(peers.reach, "this computer and 10.0.0.7, robot.local");
  EXPECT_FALSE(peers.one_computer);
  EXPECT_NE(peers.configuration.find("Address=\"127.0.0.1\"/><Peer Address=\"10.0.0.7\"/><Peer "
                                     "Address=\"robot.local\"/>"),
            std::string::npos);
  EXPECT_EQ(with_variables({{"ROS_DOMAIN_ID", "232"}}).id, 232U);
  EXPECT_TRUE(with_variables({{"CYCLONEDDS_URI", "<x/>"}, {"ROS_LOCALHOST_ONLY", "1"}})
                  .configuration.empty());
  for (const auto& [name, value] :
       std::map<std::string, std::string>{{"ROS_DOMAIN_ID", "233"},
                                          {"ROS_LOCALHOST_ONLY", "yes"},
                                          {"ROS_AUTOMATIC_DISCOVERY_RANGE", "FAR"},
                                          {"ROS_STATIC_PEERS", "\"/><x"}}) {
    EXPECT_THROW(with_variables({{name, value}}), Error) << name;
  }
}

TEST(Ros2Names, FollowRosAndDds) {
  const NodeName robot = node_name("robot/left", "r4");
  EXPECT_EQ(robot.full(), "/robot/left/r4");
  EXPECT_EQ(node_name("/", "r4"), node_name("", "r4"));
  EXPECT_EQ(full_name(robot, "osmc1/state"), "/robot/left/osmc1/state");
  EXPECT_EQ(full_name(robot, "~/stop"), "/robot/left/r4/stop");
  EXPECT_EQ(full_name(robot, "/rosout"), "/rosout");
  EXPECT_EQ(dds_topic(full_name(node_name("", "r4"), "R4")), "rt/R4");
  EXPECT_EQ(dds_request("/r4/stop"), "rq/r4/stopRequest");
  EXPECT_EQ(dds_reply("/r4/stop"), "rr/r4/stopReply");
  for (const char* wrong : {"1a", "a b", "a__b", "ü", "a/"}) {
    EXPECT_THROW(node_name(wrong, "r4"), Error) << wrong;
    EXPECT_THROW(node_name("", wrong), Error) << wrong;
  }
}

TEST(Ros2Releases, HaveOtherIdsSinceIron) {
  EXPECT_EQ(release_of(""), std::nullopt);
  EXPECT_EQ(release_of("foxy"), Release::before_iron);
  EXPECT_EQ(release_of("humble"), Release::before_iron);
  EXPECT_EQ(release_of("iron"), Release::since_iron);
  EXPECT_EQ(release_of("jazzy"), Release::since_iron);
  EXPECT_EQ(release_of("rolling"), Release::since_iron);
}

TEST(Ros2Transit, MeasuresDelayAgainstTheFastestSampleDespiteClockSkew) {
  Transit transit(Transit::Clocks::two);
  constexpr auto skew = 1h;
  const auto delay = [&](auto written, auto under_way) {
    return transit.delay(written, written + skew + under_way);
  };
  EXPECT_EQ(delay(10s, 3ms), 0ms);
  EXPECT_EQ(delay(11s, 1ms), 0ms);
  EXPECT_NEAR(static_cast<double>(delay(12s, 301ms).count()), 300e6, 2e6);
  EXPECT_GT(delay(20s, 30s), 29s) << "after an outage of the network the first sample is old";
  EXPECT_LT(delay(50s, 5ms), 10ms);
}

TEST(Ros2Transit, DetectsALateSampleAfterALongSilence) {
  Transit transit(Transit::Clocks::two);
  EXPECT_EQ(transit.delay(100s, 100s), 0s);
  EXPECT_GT(transit.delay(100s + 24h, 103s + 24h), 2400ms) << "the network has delayed the sample";
  EXPECT_LT(transit.delay(104s + 24h, 104s + 24h + 2ms), 5ms);
}

TEST(Ros2Transit, AcceptsASetClockOfASeldomSender) {
  Transit transit(Transit::Clocks::two);
  EXPECT_EQ(transit.delay(100s, 100s), 0s);
  int old = 0;
  for (int i = 1; i <= 20; ++i) {
    const auto now = 100s + i * 5s;
    if (transit.delay(now - 3s, now) > 250ms) ++old;
  }
  EXPECT_EQ(old, 9) << "the sender's clock was set";
}

TEST(Ros2Transit, ABacklogAfterALongSilenceIsNotAClockStep) {
  Transit transit(Transit::Clocks::two);
  EXPECT_EQ(transit.delay(100s, 100s), 0s);
  EXPECT_GT(transit.delay(101s, 105s), 3s);
  for (int i = 0; i < 30; ++i) {
    EXPECT_GT(transit.delay(4000s + i * 10ms, 4004s + i * 1ms), 3s) << i;
  }
}

TEST(Ros2Transit, WithOneClockMeasuresTheFirstSample) {
  Transit transit(Transit::Clocks::one);
  for (int i = 0; i < 200; ++i) {
    const auto now = 100s + i * 100ms;
    EXPECT_EQ(transit.delay(now - 300ms, now), 300ms) << i;
  }
  EXPECT_EQ(transit.delay(500s, 90s), 0s) << "the sender's clock was set back meanwhile";
}

TEST(Ros2Transit, AcceptsASetClockAfterTenSeconds) {
  Transit transit(Transit::Clocks::two);
  EXPECT_EQ(transit.delay(100s, 100s), 0s);
  for (int i = 1; i < 100; ++i) {
    const auto now = 100s + i * 100ms;
    EXPECT_GT(transit.delay(now - 5s, now), 4s) << i;
  }
  EXPECT_EQ(transit.delay(105s + 100ms, 110s + 100ms), 0s);
  EXPECT_EQ(transit.delay(500s, 90s), 0s) << "our clock was set back";
}

TEST(Ros2Outbox, DropsTheOldestJobAndNeverBlocks) {
  Outbox outbox(2);
  std::promise<void> begun;
  std::promise<void> go_on;
  outbox.push([&] {
    begun.set_value();
    go_on.get_future().wait();
  });
  begun.get_future().wait();
  std::string done;
  std::promise<void> end;
  for (const char c : {'a', 'b'}) outbox.push([&done, c] { done += c; });
  outbox.push([&] {
    done += 'c';
    end.set_value();
  });
  EXPECT_EQ(outbox.lost(), 1U);
  go_on.set_value();
  end.get_future().wait();
  EXPECT_EQ(done, "bc");
}

TEST(Ros2Outbox, RepeatsAnAttemptForAWhileBetweenOtherJobs) {
  Outbox outbox;
  std::promise<int> given_up;
  std::atomic<int> tries{0};
  std::atomic<int> jobs{0};
  outbox.push_attempt([&](bool last) {
    ++tries;
    outbox.push([&] { ++jobs; });
    if (last) given_up.set_value(jobs);
    return last;
  });
  EXPECT_GE(given_up.get_future().get(), 1) << "other jobs must run between two tries";
  outbox.push_attempt([&](bool) { return ++tries > 0; });
  std::promise<void> end;
  outbox.push([&] { end.set_value(); });
  end.get_future().wait();
  EXPECT_EQ(tries, jobs + 1) << "a job that has succeeded must not be tried again";
}

}  // namespace
}  // namespace r4::tool::ros2
