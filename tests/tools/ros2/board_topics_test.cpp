// SPDX-License-Identifier: GPL-3.0-or-later
// The topics of a board whose states arrive in several datagrams. A link that carries whole states
// cannot test this case.
#include "tools/r4/ros2/board_topics.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cmath>

namespace r4::tool::ros2 {
namespace {

class JointStates : public ::testing::Test {
 protected:
  static NodeOptions options_of() {
    NodeOptions options;
    options.counts_per_turn = 4096;
    for (const StateField field :
         {StateField::enc1, StateField::enc2, StateField::enc1hz, StateField::enc2hz}) {
      options.fields.add(field);
    }
    return options;
  }
  // A part of the state with this T.
  void part(std::uint32_t t_ms, std::initializer_list<StateField> fields) {
    state.t_ms = t_ms;
    state.present = FieldSet();
    for (const StateField field : fields) state.present.add(field);
    topics.on_state(state, BoardTopics::WallTime(std::chrono::milliseconds(t_ms)), boot);
  }
  struct Told {
    std::vector<std::string> names;
    std::vector<double> positions;
    std::vector<double> velocities;
    std::uint32_t stamp_ns = 0;
  };
  std::vector<Told> told() {
    std::array<void*, 8> samples{};
    std::array<dds_sample_info_t, 8> infos{};
    const dds_return_t count = dds_take(reader.get(), samples.data(), infos.data(), 8, 8);
    std::vector<Told> all;
    for (std::size_t i = 0; count > 0 && i < static_cast<std::size_t>(count); ++i) {
      const auto& message = *static_cast<const JointStateMessage*>(samples[i]);
      Told& each = all.emplace_back();
      for (std::uint32_t n = 0; n < message.name._length; ++n)
        each.names.emplace_back(message.name._buffer[n]);
      each.positions.assign(message.position._buffer,
                            message.position._buffer + message.position._length);
      each.velocities.assign(message.velocity._buffer,
                             message.velocity._buffer + message.velocity._length);
      each.stamp_ns = message.header.stamp.nanosec;
    }
    if (count > 0) (void)dds_return_loan(reader.get(), samples.data(), count);
    return all;
  }

  Graph graph{domain_of([](const char* name) {
    return std::string(name) == "ROS_DOMAIN_ID" ? std::to_string(1 + ::getpid() % 200) : "";
  })};
  std::size_t node = graph.add_node(node_name("", "r4"));
  BoardTopics topics{graph, node, options_of()};
  Entity topic{dds_create_topic(graph.participant(), message_type<JointStateMessage>().descriptor,
                                "rt/joint_states", make_qos({}).get(), nullptr),
               "joint_states"};
  Entity reader{dds_create_reader(graph.participant(), topic.get(), make_qos({}).get(), nullptr),
                "joint_states"};
  State state;
  std::uint32_t boot = 0;
};

// 508 bytes is the limit of the Giga's WiFi.
TEST_F(JointStates, AStateInSeveralDatagramsIsOneSample) {
  state.raw.encoder_hz[0] = 4096;
  state.raw.encoder_hz[1] = 2048;
  part(1010, {StateField::enc1, StateField::enc2});
  EXPECT_TRUE(told().empty()) << "the other half has not come yet";
  part(1010, {StateField::enc1hz, StateField::enc2hz});
  const auto all = told();
  ASSERT_EQ(all.size(), 1U);
  EXPECT_EQ(all[0].names, (std::vector<std::string>{"encoder1", "encoder2"}));
  EXPECT_EQ(all[0].stamp_ns, 10'000'000U);
  EXPECT_NEAR(all[0].velocities[0], 6.2832, 1e-3);
  EXPECT_NEAR(all[0].velocities[1], 3.1416, 1e-3);
}

TEST_F(JointStates, AStateWithALostPartIsPublishedWithoutIt) {
  part(1010, {StateField::enc1, StateField::enc2});
  part(1020, {StateField::enc1, StateField::enc2});
  auto all = told();
  ASSERT_EQ(all.size(), 1U);
  EXPECT_EQ(all[0].names.size(), 2U);
  EXPECT_TRUE(std::isnan(all[0].velocities[0]));
  EXPECT_EQ(all[0].stamp_ns, 10'000'000U);
  part(1020, {StateField::enc1hz, StateField::enc2hz});
  all = told();
  ASSERT_EQ(all.size(), 1U);
  EXPECT_FALSE(std::isnan(all[0].velocities[0]));
}

TEST_F(JointStates, ARestartOfTheBoardDoesNotMoveAPosition) {
  const auto position = [this](std::uint32_t t_ms, std::int32_t counts) {
    state.raw.encoder_counts[0] = counts;
    part(t_ms, {StateField::enc1, StateField::enc2, StateField::enc1hz, StateField::enc2hz});
    const auto all = told();
    return all.size() == 1 ? all[0].positions[0] : std::nan("");
  };
  EXPECT_NEAR(position(1000, 4096), 6.2832, 1e-3);
  boot = 1;
  EXPECT_NEAR(position(500, 3), 6.2832, 1e-3);
}

}  // namespace
}  // namespace r4::tool::ros2
