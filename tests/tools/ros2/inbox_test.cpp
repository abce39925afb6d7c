// SPDX-License-Identifier: GPL-3.0-or-later
// The loop receives samples that Cyclone DDS sends within this process.
#include "tools/r4/ros2/graph/inbox.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <asio/io_context.hpp>
#include <functional>
#include <vector>

#include "tools/r4/ros2/graph/graph.hpp"

namespace r4::tool::ros2 {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

Domain of_this_process() {
  return domain_of([](const char* name) {
    return std::string(name) == "ROS_DOMAIN_ID" ? std::to_string(1 + ::getpid() % 200) : "";
  });
}

class InboxTest : public ::testing::Test {
 protected:
  InboxTest() {
    const std::size_t node = graph.add_node(node_name("", "r4"));
    inbox.add<BoolMessage, bool>({
        .reader = graph.subscribe<BoolMessage>(node, "stop"),
        .room = 1,
        .read = [](const BoolMessage& message) { return std::optional(message.data != 0); },
        .urgent = [](bool pressed) { return pressed; },
        .take = [this](bool, const Origin&) { taken.emplace_back("stop"); },
        .left = {},
    });
    inbox.add<Float32Message, float>({
        .reader = duty_reader = graph.subscribe<Float32Message>(node, "duty"),
        .room = 1,
        .read = [](const Float32Message& message) { return std::optional(message.data); },
        .urgent = {},
        .take =
            [this](float duty, const Origin& origin) {
              taken.push_back("duty " + std::to_string(static_cast<int>(duty)));
              writers.push_back(origin.writer);
            },
        .left =
            [this](const auto& there) { taken.push_back("left " + std::to_string(there.size())); },
    });
    inbox.start();
  }

  template <class Message>
  Entity writer_of(const char* topic) {
    const Entity made_topic(
        dds_create_topic(other.get(), message_type<Message>().descriptor, topic, nullptr, nullptr),
        topic);
    return {dds_create_writer(other.get(), made_topic.get(), make_qos({}).get(), nullptr), topic};
  }
  void write_duty(const Entity& writer, float duty) {
    const Float32Message message{duty};
    ASSERT_EQ(dds_write(writer.get(), &message), 0);
  }
  void write_stop(const Entity& writer) {
    const BoolMessage message{1};
    ASSERT_EQ(dds_write(writer.get(), &message), 0);
  }
  bool until(const std::function<bool()>& is_so) {
    const auto deadline = Clock::now() + 10s;
    while (!is_so() && Clock::now() < deadline) {
      io.restart();
      io.run_for(1ms);
    }
    return is_so();
  }
  bool has(const std::string& what) const {
    return std::find(taken.begin(), taken.end(), what) != taken.end();
  }
  static bool is_matched(const Entity& writer) {
    dds_publication_matched_status_t matched{};
    return dds_get_publication_matched_status(writer.get(), &matched) == 0 &&
           matched.current_count == 1;
  }

  Domain domain = of_this_process();
  asio::io_context io;
  Graph graph{domain};
  Entity other{dds_create_participant(domain.id, nullptr, nullptr), "another participant"};
  dds_entity_t duty_reader = 0;
  std::vector<std::string> taken;
  std::vector<EntityId> writers;
  Inbox inbox{io, Transit::Clocks::one, [this] { taken.emplace_back("-"); }};
};

TEST_F(InboxTest, DeliversTheLastSampleOfAPublisherBeforeItsEnd) {
  Entity writer = writer_of<Float32Message>("rt/duty");
  ASSERT_TRUE(until([&] { return has("left 1"); }));
  taken.clear();
  write_duty(writer, 7);
  writer.reset();
  const auto deadline = Clock::now() + 10s;  // the loop is busy during this time
  while (dds_get_matched_publications(duty_reader, nullptr, 0) != 0 && Clock::now() < deadline) {
    std::this_thread::yield();
  }
  ASSERT_TRUE(until([&] { return has("left 0"); }));
  std::erase(taken, "-");
  EXPECT_EQ(taken, (std::vector<std::string>{"duty 7", "left 0"}));
}

TEST_F(InboxTest, NamesThePublisherOfASample) {
  const Entity writer = writer_of<Float32Message>("rt/duty");
  ASSERT_TRUE(until([&] { return is_matched(writer); }));
  write_duty(writer, 1);
  ASSERT_TRUE(until([&] { return !writers.empty(); }));
  EXPECT_EQ(writers[0], id_of(writer.get()));
}

// Even after many stops, a later sample waits for only one turn of the loop, not for one turn per
// stop.
TEST_F(InboxTest, StopsDoNotDelayOtherSamples) {
  const Entity stops = writer_of<BoolMessage>("rt/stop");
  const Entity duties = writer_of<Float32Message>("rt/duty");
  ASSERT_TRUE(until([&] { return is_matched(stops) && has("left 1"); }));
  constexpr int many = 500;  // 5 s if each stop needed a turn
  for (int i = 0; i < many; ++i) {
    taken.clear();
    write_stop(stops);
    ASSERT_TRUE(until([&] { return has("-"); })) << i;
    ASSERT_EQ(taken[0], "stop");
  }
  const auto written = Clock::now();
  write_duty(duties, 3);
  ASSERT_TRUE(until([&] { return has("duty 3"); }));
  EXPECT_LT(Clock::now() - written, 2s);
}

}  // namespace
}  // namespace r4::tool::ros2
