// SPDX-License-Identifier: GPL-3.0-or-later
// The time of a state from the link to a ROS 2 subscriber. The reference is a sample of the same
// size that a program with only Cyclone DDS writes.
//
//     r4_ros2_bench [SAMPLES]      exit code 1 if a state takes more than 1.3 times as long
//
// Two processes on loopback. One process publishes all topics of a board through the outbox, as r4
// ros2 does. The other process subscribes. A state and a plain sample take turns, 5 ms apart. Each
// sample carries the time at which the sample was ready.
#include <dds/dds.h>
#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "tests/bench/link/child_process.hpp"
#include "tools/r4/ros2/board_topics.hpp"
#include "tools/r4/ros2/graph/outbox.hpp"

namespace r4::bench {
namespace {

using namespace std::chrono_literals;
using tool::ros2::StringMessage;
using Clock = std::chrono::steady_clock;

constexpr std::size_t size = 170;  // the usual size of a state
constexpr auto period = 5ms;

std::int64_t now_ns() { return Clock::now().time_since_epoch() / 1ns; }

std::string stamped() {
  std::string text = fmt::format("{:020}", now_ns());
  text.resize(size, ' ');
  return text;
}

tool::ros2::Domain domain() {
  return tool::ros2::domain_of(
      [](const char* name) { return std::string(name) == "ROS_DOMAIN_ID" ? "97" : ""; });
}

// The delay of each sample of a topic, in ns.
class Delays {
 public:
  Delays(tool::ros2::Graph& graph, const char* topic)
      : reader_(graph.subscribe<StringMessage>(0, topic)) {}
  dds_entity_t reader() const { return reader_; }
  std::size_t count() const { return delays_.size(); }
  void take() {
    std::array<void*, 16> samples{};
    std::array<dds_sample_info_t, 16> infos{};
    const dds_return_t taken = dds_take(reader_, samples.data(), infos.data(), 16, 16);
    const std::int64_t now = now_ns();
    for (std::size_t i = 0; taken > 0 && i < static_cast<std::size_t>(taken); ++i) {
      if (!infos[i].valid_data) continue;
      const auto& data = static_cast<const StringMessage*>(samples[i])->data;
      delays_.push_back(now - std::atoll(reinterpret_cast<const char*>(data._buffer)));
    }
    if (taken > 0) (void)dds_return_loan(reader_, samples.data(), taken);
  }
  double quantile_us(double q) {
    std::sort(delays_.begin(), delays_.end());
    return static_cast<double>(
               delays_[static_cast<std::size_t>(q * static_cast<double>(delays_.size() - 1))]) /
           1e3;
  }

 private:
  dds_entity_t reader_;
  std::vector<std::int64_t> delays_;
};

int subscribe(std::size_t samples) {
  tool::ros2::Graph graph(domain());
  graph.add_node({});
  Delays state(graph, "R4");
  Delays plain(graph, "plain");
  const dds_entity_t waitset = dds_create_waitset(graph.participant());
  for (const Delays* each : {&state, &plain}) {
    (void)dds_waitset_attach(waitset, dds_create_readcondition(each->reader(), DDS_ANY_STATE), 0);
  }
  while (std::min(state.count(), plain.count()) < samples) {
    if (dds_waitset_wait(waitset, nullptr, 0, DDS_SECS(5)) <= 0) break;
    state.take();
    plain.take();
  }
  if (std::min(state.count(), plain.count()) == 0) return 1;
  for (auto [name, delays] : {std::pair{"plain sample", &plain}, std::pair{"state", &state}}) {
    fmt::print("{:14} p50 {:6.1f} us   p99 {:7.1f} us\n", name, delays->quantile_us(0.5),
               delays->quantile_us(0.99));
  }
  const double ratio = state.quantile_us(0.5) / plain.quantile_us(0.5);
  fmt::print("ratio {:.2f}, aim 1.30: {}\n", ratio, ratio <= 1.3 ? "met" : "not met");
  return ratio <= 1.3 ? 0 : 1;
}

void publish(std::size_t samples) {
  tool::ros2::Graph graph(domain());
  const std::size_t node = graph.add_node({});
  tool::ros2::NodeOptions options;
  options.fields = FieldSet::all();
  const auto topics = std::make_shared<tool::ros2::BoardTopics>(graph, node, options);
  const dds_entity_t plain = graph.publish<StringMessage>(node, "plain");
  tool::ros2::Outbox outbox;
  dds_publication_matched_status_t matched{};
  while (matched.current_count == 0) {
    (void)dds_get_publication_matched_status(plain, &matched);
    std::this_thread::sleep_for(10ms);
  }
  State state{};
  state.present = options.fields;
  auto next = Clock::now();
  for (std::size_t i = 0; i < samples; ++i) {
    std::this_thread::sleep_until(next += period);
    ++state.raw.analog_cv[0];
    // The same code as in BoardNode.
    outbox.push([topics, state, line = stamped(), sampled = std::chrono::system_clock::now()] {
      topics->on_datagram(line);
      topics->on_state(state, sampled, 0);
    });
    std::this_thread::sleep_until(next += period);
    std::string text = stamped();
    StringMessage message{};
    message.data._length = message.data._maximum = static_cast<std::uint32_t>(text.size() + 1);
    message.data._buffer = reinterpret_cast<std::uint8_t*>(text.data());
    (void)dds_write(plain, &message);
  }
}

int run(std::size_t samples) {
  const pid_t child = ::fork();
  require(child >= 0, "fork");
  if (child == 0) std::exit(subscribe(samples));
  publish(samples);
  int status = 0;
  require(::waitpid(child, &status, 0) == child, "waitpid");
  return WIFEXITED(status) ? WEXITSTATUS(status) : 1;
}

}  // namespace
}  // namespace r4::bench

int main(int argc, char** argv) {
  return r4::bench::run(argc > 1 ? static_cast<std::size_t>(std::atoi(argv[1])) : 1000);
}
