// SPDX-License-Identifier: GPL-3.0-or-later
// Measurements of described devices by role (imu, battery, range, joint_states), each published
// once, with the board's time. After construction only the outbox's thread uses this object.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "graph/graph.hpp"
#include "graph/message_types.hpp"
#include "r4link/devices/device.hpp"

namespace r4::tool::ros2 {

class DeviceTopics {
 public:
  using WallTime = std::chrono::system_clock::time_point;

  DeviceTopics(Graph& graph, std::size_t node, const std::vector<Device>& devices);
  void on_state(const State& state, WallTime sampled);

 private:
  struct Topic {
    Device device;
    std::string name;  // name of device, frame and joint; with the address if not unique
    dds_entity_t writer = 0;
    std::size_t value = 0;  // index of the main value
    std::optional<std::uint32_t> t_ms;
  };
  void publish(const Topic& topic, const State& state, TimeMessage time) const;
  void publish_imu(const Topic& topic, const State& state, TimeMessage time) const;
  void publish_battery(const Topic& topic, const State& state, TimeMessage time) const;
  void publish_range(const Topic& topic, const State& state, TimeMessage time) const;
  void publish_joint(const Topic& topic, const State& state, TimeMessage time) const;

  std::string frame_prefix_;
  std::vector<Topic> topics_;
};

}  // namespace r4::tool::ros2
