// SPDX-License-Identifier: GPL-3.0-or-later
// Faults of other programs' readers and writers, found in their announcements, and a graph of many
// nodes.
#include "tools/r4/ros2/discovery/mismatches.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <string>

#include "r4link/error.hpp"

namespace r4::tool::ros2 {
namespace {

const std::string twist = "geometry_msgs::msg::dds_::Twist_";

Graph::OwnTopic own_of(EndpointKind kind, const std::string& name, const std::string& type) {
  Graph::OwnTopic own;
  own.endpoints.push_back({kind, 0, name, type, Policies{}});
  return own;
}

Announced other_of(EndpointKind kind, const std::string& type) {
  Announced other;
  other.kind = kind;
  other.type = type;
  other.owner = "process 7 on robot";
  return other;
}

std::string words_of(const std::optional<Mismatch>& mismatch) {
  return mismatch ? mismatch->text : "none";
}

TEST(GraphMismatch, NamesAPublisherOfAnotherType) {
  const auto own = own_of(EndpointKind::reader, "cmd_vel", twist);
  EXPECT_FALSE(mismatch_of(own, other_of(EndpointKind::writer, twist)));
  const auto wrong =
      mismatch_of(own, other_of(EndpointKind::writer, "std_msgs::msg::dds_::Float64_"));
  EXPECT_EQ(words_of(wrong),
            "cmd_vel: a publisher (process 7 on robot) has the wrong type std_msgs/msg/Float64, "
            "so its messages are ignored; publish geometry_msgs/msg/Twist");
  EXPECT_EQ(wrong->weight, Mismatch::Weight::lost);
  EXPECT_FALSE(mismatch_of(own, other_of(EndpointKind::reader, "anything")))
      << "a subscriber to a command topic must not be reported";
}

TEST(GraphMismatch, NamesASubscriberOfAnotherType) {
  const auto own = own_of(EndpointKind::writer, "encoder1", "std_msgs::msg::dds_::Int32_");
  const auto wrong = mismatch_of(own, other_of(EndpointKind::reader, "a\x1b[31m"));
  EXPECT_EQ(words_of(wrong),
            "encoder1: a subscriber (process 7 on robot) has the wrong type a\\x1b[31m, so it "
            "receives nothing; subscribe to std_msgs/msg/Int32");
  EXPECT_EQ(wrong->weight, Mismatch::Weight::warning);
}

TEST(GraphMismatch, NamesThePolicyThatAWriterDoesNotFulfil) {
  const Policies usual;
  EXPECT_EQ(unmatched_policy(usual, usual), nullptr);
  const auto with = [](auto member, auto value) {
    Policies policies;
    policies.*member = value;
    return policies;
  };
  const auto best_effort = with(&Policies::reliable, false);
  const auto latched = with(&Policies::durability, DDS_DURABILITY_TRANSIENT_LOCAL);
  const auto soon = with(&Policies::deadline, DDS_MSECS(10));
  const auto lively = with(&Policies::lease, DDS_MSECS(10));
  const auto manual = with(&Policies::liveliness, DDS_LIVELINESS_MANUAL_BY_TOPIC);
  const auto xcdr2 = with(&Policies::xcdr1, false);
  EXPECT_STREQ(unmatched_policy(best_effort, usual), "reliability");
  EXPECT_STREQ(unmatched_policy(usual, latched), "durability");
  EXPECT_STREQ(unmatched_policy(usual, soon), "deadline");
  EXPECT_STREQ(unmatched_policy(usual, lively), "liveliness");
  EXPECT_STREQ(unmatched_policy(usual, manual), "liveliness");
  EXPECT_STREQ(unmatched_policy(xcdr2, usual), "XCDR1");
  for (const Policies& more : {latched, soon, lively, manual}) {
    EXPECT_EQ(unmatched_policy(more, usual), nullptr);
  }
  EXPECT_EQ(unmatched_policy(usual, best_effort), nullptr);

  auto reader = other_of(EndpointKind::reader, twist);
  reader.policies = latched;
  EXPECT_EQ(words_of(mismatch_of(own_of(EndpointKind::writer, "R4", twist), reader)),
            "R4: a subscriber requires more durability than this publisher offers, so it receives "
            "nothing (process 7 on robot); use the default settings of ROS");
}

TEST(GraphMismatch, IsNotReportedIfOneOfSeveralReadersMatches) {
  auto own = own_of(EndpointKind::reader, "stop", twist);
  auto writer = other_of(EndpointKind::writer, twist);
  writer.policies.reliable = false;
  EXPECT_TRUE(mismatch_of(own, writer));
  own.endpoints.push_back(own.endpoints[0]);
  own.endpoints[1].policies.reliable = false;
  EXPECT_FALSE(mismatch_of(own, writer));
}

TEST(GraphMismatch, NamesAServiceClientThatCannotBeAnswered) {
  const auto own = own_of(EndpointKind::reader, "~/stop", twist);
  auto client = other_of(EndpointKind::writer, twist);
  EXPECT_NE(words_of(mismatch_of(own, client)).find("rmw_cyclonedds_cpp"), std::string::npos);
  client.user_data = "clientid=1.2;";
  EXPECT_FALSE(mismatch_of(own, client));
}

TEST(GraphMismatch, IsReportedIfNoReaderCanBeMadeForAnotherType) {
  auto own = own_of(EndpointKind::reader, "stop", twist);
  own.name = "stop";
  own.other_type = [](const Announced&) -> std::optional<Mismatch> {
    throw Error(ErrorKind::open, "rt/stop", "cannot be made", "look");
  };
  const auto other = other_of(EndpointKind::writer, "another");
  EXPECT_EQ(
      words_of(mismatch_of(own, other)),
      "stop: a publisher (process 7 on robot) is not received: rt/stop: cannot be made; look");
}

Domain own_test_domain() {
  return domain_of([](const char* name) {
    return std::string(name) == "ROS_DOMAIN_ID" ? std::to_string(1 + ::getpid() % 200) : "";
  });
}

TEST(GraphMismatch, IsWithdrawnWhenItsCauseDisappears) {
  Graph graph(own_test_domain());
  const std::size_t node = graph.add_node(node_name("", "r4"));
  graph.subscribe<TwistMessage>(node, "cmd_vel");
  graph.on_other_type(node, "relay1/command", [](const Announced&) {
    return Mismatch{Mismatch::Weight::lost, "relay1/command: why"};
  });
  std::vector<std::string> told;
  Mismatches mismatches(graph, [&told](std::size_t, const EntityId&, const auto& mismatch) {
    told.push_back(words_of(mismatch).substr(0, 14));
  });
  auto writer = other_of(EndpointKind::writer, "std_msgs::msg::dds_::Empty_");
  for (const char* topic : {"rt/cmd_vel", "rt/another", "rt/relay1/command"}) {
    writer.topic = topic;
    writer.id[0] = static_cast<std::uint8_t>(told.size());
    mismatches.on_announced(writer);
  }
  writer.gone = true;
  mismatches.on_announced(writer);
  mismatches.on_announced(writer);
  EXPECT_EQ(told, (std::vector<std::string>{"cmd_vel: a pub", "relay1/command", "none"}));
}

// Cyclone DDS can make 16383 entities for a participant.
TEST(GraphWithManyNodes, HasRoomForAllTheirTopics) {
  Graph graph(own_test_domain());
  for (int n = 0; n < 80; ++n) {
    const std::size_t node = graph.add_node(node_name("board" + std::to_string(n), "r4"));
    for (int i = 0; i < 105; ++i) {
      graph.publish<StringMessage>(node, "topic" + std::to_string(i));
    }
  }
  EXPECT_EQ(graph.participants().size(), 2U);
}

}  // namespace
}  // namespace r4::tool::ros2
