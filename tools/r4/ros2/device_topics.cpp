// SPDX-License-Identifier: GPL-3.0-or-later
#include "device_topics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <string_view>
#include <utility>

namespace r4::tool::ros2 {
namespace {

double number_of(const Device& device, const State& state, std::string_view value) {
  return device.reading(state, value).number.value_or(std::numeric_limits<double>::quiet_NaN());
}

// The raw value, even out of range. Empty before the first reading, or for another device's slot.
std::optional<double> any_number_of(const Device& device, const State& state, std::size_t value) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  DeviceValue any = device.description().values[value];
  any.minimum = -infinity;
  any.maximum = infinity;
  const std::size_t slot = static_cast<std::size_t>(device.first_slot() - 1) + any.poll;
  const auto& bytes = state.raw.i2c[slot].data;
  if (bytes.size != device.description().polls[any.poll].count) return std::nullopt;
  return any.decode(bytes.bytes, bytes.size);
}

TimeMessage device_stamp(DeviceTopics::WallTime time) {
  const auto since = std::chrono::duration_cast<std::chrono::nanoseconds>(time.time_since_epoch());
  constexpr std::int64_t second = 1'000'000'000;
  return {static_cast<std::int32_t>(since.count() / second),
          static_cast<std::uint32_t>(since.count() % second)};
}

}  // namespace

DeviceTopics::DeviceTopics(Graph& graph, std::size_t node, const std::vector<Device>& devices)
    : frame_prefix_(graph.node(node).space == "/" ? "" : graph.node(node).space.substr(1) + "/") {
  for (const Device& device : devices) {
    const std::string& name = device.description().name;
    const auto is_namesake = [&name](const Device& each) {
      return each.description().name == name;
    };
    const bool several = std::count_if(devices.begin(), devices.end(), is_namesake) > 1;
    Topic topic{
        device, several ? fmt::format("{}_{:02x}", name, device.address()) : name, 0, 0, {}};
    const auto add = [&]<class Message>(std::in_place_type_t<Message>, const char* kind,
                                        const char* value) {
      topic.writer = graph.publish<Message>(node, topic.name + kind);
      topic.value = device.description().find(value).value();
    };
    switch (device.description().role) {
      case DeviceRole::imu:
        add(std::in_place_type<ImuMessage>, "/imu", "accel_x");
        break;
      case DeviceRole::power:
        add(std::in_place_type<BatteryMessage>, "/battery", "voltage");
        break;
      case DeviceRole::range:
        add(std::in_place_type<RangeMessage>, "/range", "distance");
        break;
      case DeviceRole::angle:
        add(std::in_place_type<JointStateMessage>, "/joint_states", "angle");
        break;
      case DeviceRole::none:
        continue;  // ROS has no message for it
    }
    topics_.push_back(std::move(topic));
  }
}

void DeviceTopics::on_state(const State& state, WallTime sampled) {
  for (Topic& topic : topics_) {
    if (!state.present.has(topic.device.field(topic.value))) continue;
    const DeviceReading reading = topic.device.reading(state, topic.value);
    // A distance outside the device's range is published too: nothing within reach, or too near.
    // A device that is not set up has no valid measurement.
    const bool told = topic.device.description().role == DeviceRole::range
                          ? topic.device.is_set_up(state).value_or(true) &&
                                any_number_of(topic.device, state, topic.value).has_value()
                          : reading.number.has_value();
    if (!told || reading.t_ms == 0 || topic.t_ms == reading.t_ms) continue;
    topic.t_ms = reading.t_ms;
    const auto age =
        std::chrono::milliseconds{static_cast<std::int32_t>(state.t_ms - reading.t_ms)};
    publish(topic, state, device_stamp(sampled - age));
  }
}

void DeviceTopics::publish(const Topic& topic, const State& state, TimeMessage time) const {
  switch (topic.device.description().role) {
    case DeviceRole::imu:
      return publish_imu(topic, state, time);
    case DeviceRole::power:
      return publish_battery(topic, state, time);
    case DeviceRole::range:
      return publish_range(topic, state, time);
    case DeviceRole::angle:
      return publish_joint(topic, state, time);
    case DeviceRole::none:
      return;
  }
}

void DeviceTopics::publish_imu(const Topic& topic, const State& state, TimeMessage time) const {
  const auto get = [&](const char* value) { return number_of(topic.device, state, value); };
  const std::string frame = frame_prefix_ + topic.name;
  ImuMessage message{};  // covariances of 0: not known
  message.header.stamp = time;
  message.header.frame_id = borrowed(frame);
  message.linear_acceleration = {get("accel_x"), get("accel_y"), get("accel_z")};
  message.angular_velocity = {get("gyro_x"), get("gyro_y"), get("gyro_z")};
  if (topic.device.description().find("quat_w")) {
    message.orientation = {get("quat_x"), get("quat_y"), get("quat_z"), get("quat_w")};
    // A BNO055 in configuration mode reports 0 for all values (BST-BNO055-DS000, 3.3.1).
    const auto& [x, y, z, w] = message.orientation;
    if (x * x + y * y + z * z + w * w < 0.5) return;
  } else {
    message.orientation.w = 1;
    message.orientation_covariance[0] = -1;  // no orientation
  }
  (void)dds_write(topic.writer, &message);
}

void DeviceTopics::publish_battery(const Topic& topic, const State& state, TimeMessage time) const {
  constexpr float not_measured = std::numeric_limits<float>::quiet_NaN();
  std::string none;
  const std::string frame = frame_prefix_ + topic.name;
  BatteryMessage message{};
  message.header.stamp = time;
  message.header.frame_id = borrowed(frame);
  message.voltage = static_cast<float>(number_of(topic.device, state, "voltage"));
  // In ROS a discharge current is negative.
  message.current = -static_cast<float>(number_of(topic.device, state, "current"));
  for (float* value : {&message.temperature, &message.charge, &message.capacity,
                       &message.design_capacity, &message.percentage}) {
    *value = not_measured;
  }
  message.present = true;
  message.location = borrowed(none);
  message.serial_number = borrowed(none);
  (void)dds_write(topic.writer, &message);
}

void DeviceTopics::publish_range(const Topic& topic, const State& state, TimeMessage time) const {
  constexpr std::uint8_t infrared = 1;
  const DeviceValue& distance = topic.device.description().values[topic.value];
  const std::string frame = frame_prefix_ + topic.name;
  RangeMessage message{};  // field of view 0: unknown
  message.header.stamp = time;
  message.header.frame_id = borrowed(frame);
  message.radiation_type = infrared;
  message.min_range = static_cast<float>(distance.minimum);
  message.max_range = static_cast<float>(distance.maximum);
  // REP 117: too near is -Inf, nothing within reach +Inf, rejected by the device NaN.
  constexpr float infinity = std::numeric_limits<float>::infinity();
  const double measured = any_number_of(topic.device, state, topic.value).value();
  if (measured > distance.maximum) {
    message.range = infinity;
  } else if (!topic.device.counts(state, topic.value)) {
    message.range = std::numeric_limits<float>::quiet_NaN();
  } else {
    message.range = measured < distance.minimum ? -infinity : static_cast<float>(measured);
  }
  (void)dds_write(topic.writer, &message);
}

void DeviceTopics::publish_joint(const Topic& topic, const State& state, TimeMessage time) const {
  std::string none;
  char* name = borrowed(topic.name);
  double position = number_of(topic.device, state, "angle");
  JointStateMessage message{};
  message.header.stamp = time;
  message.header.frame_id = borrowed(none);
  message.name._length = message.name._maximum = 1;
  message.name._buffer = &name;
  message.position._length = message.position._maximum = 1;
  message.position._buffer = &position;
  (void)dds_write(topic.writer, &message);
}

}  // namespace r4::tool::ros2
