// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_topics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace r4::tool::ros2 {
namespace {

constexpr float unknown = std::numeric_limits<float>::quiet_NaN();

// The field of channel 1 and those behind it, which are not one after another for channel 1.
StateField field_of(StateField first, StateField second, int channel) {
  return channel == 1 ? first : static_cast<StateField>(static_cast<int>(second) + channel - 2);
}
StateField osmc_field(int channel) {
  return field_of(StateField::osmc1, StateField::osmc2, channel);
}
StateField dhb12_field(int channel) {
  return field_of(StateField::dhb1a, StateField::dhb1b, channel);
}
StateField servo_field(int channel) {
  return field_of(StateField::servo1pos, StateField::servo2pos, channel);
}
StateField stepper_field(int channel) {
  return field_of(StateField::step1pos, StateField::step2pos, channel);
}
StateField nth(StateField first, int channel) {
  return static_cast<StateField>(static_cast<int>(first) + channel - 1);
}

struct AnalogTopic {
  StateField field;
  const char* topic;
};
constexpr std::array<AnalogTopic, analog_channels> analog_topics{{
    {StateField::ain24, "analog/ain24"},
    {StateField::ain12, "analog/ain12"},
    {StateField::ain5, "analog/ain5"},
    {StateField::aindmh, "analog/aindmh"},
    {StateField::ainsteer, "analog/ainsteer"},
    {StateField::ain6, "analog/ain6"},
}};  // in the order of Analog

TimeMessage stamp(BoardTopics::WallTime time) {
  const auto since = std::chrono::duration_cast<std::chrono::nanoseconds>(time.time_since_epoch());
  constexpr std::int64_t second = 1'000'000'000;
  return {static_cast<std::int32_t>(since.count() / second),
          static_cast<std::uint32_t>(since.count() % second)};
}

template <class Sequence, class Value>
void point(Sequence& sequence, std::vector<Value>& values) {
  sequence._length = sequence._maximum = static_cast<std::uint32_t>(values.size());
  sequence._buffer = values.data();
}

}  // namespace

BoardTopics::BoardTopics(Graph& graph, std::size_t node, const NodeOptions& options)
    : options_(options),
      node_name_(graph.node(node).full()),
      frame_prefix_(graph.node(node).space == "/" ? "" : graph.node(node).space.substr(1) + "/"),
      raw_(graph.publish<StringMessage>(node, "R4")),
      heartbeat_(graph.publish<StringMessage>(node, "R4_Heart_Beat")),
      active_(graph.publish<StringMessage>(node, "R4_Active")),
      diagnostics_(graph.publish<DiagnosticsMessage>(node, "/diagnostics")) {
  Qos kept;
  kept.depth = 1000;
  kept.transient_local = true;
  kept.lifespan = DDS_SECS(10);
  rosout_ = graph.publish<LogMessage>(node, "/rosout", kept);
  const FieldSet& fields = options.fields;
  for (int n = 1; n <= osmc_channels; ++n) {
    const auto i = static_cast<std::size_t>(n - 1);
    if (fields.has(osmc_field(n))) {
      osmc_[i].writer = graph.publish<Float32Message>(node, fmt::format("osmc{}/state", n));
    }
    if (fields.has(dhb12_field(n))) {
      dhb12_[i].writer = graph.publish<Float32Message>(node, fmt::format("dhb12_{}/state", n));
    }
    if (fields.has(nth(StateField::bldc1, n))) {
      bldc_[i].writer = graph.publish<Float32Message>(node, fmt::format("bldc{}/state", n));
    }
    if (fields.has(nth(StateField::enc1, n))) {
      encoders_[i].writer = graph.publish<Int32Message>(node, fmt::format("encoder{}", n));
    }
    if (fields.has(stepper_field(n))) {
      steppers_[i].writer = graph.publish<Int32Message>(node, fmt::format("stepper{}/state", n));
    }
    if (fields.has(nth(StateField::us1, n))) {
      ranges_[i].writer = graph.publish<RangeMessage>(node, fmt::format("range/us{}", n));
    }
  }
  for (int n = 1; n <= servo_channels; ++n) {
    if (!fields.has(servo_field(n))) continue;
    servos_[static_cast<std::size_t>(n - 1)].writer =
        graph.publish<Float32Message>(node, fmt::format("servo{}/state", n));
  }
  for (std::size_t i = 0; i < analog_.size(); ++i) {
    if (!fields.has(analog_topics[i].field)) continue;
    analog_[i].writer = graph.publish<Float32Message>(node, analog_topics[i].topic);
  }
  if (fields.has(StateField::relays)) relays_.writer = graph.publish<UInt32Message>(node, "relays");
  if (fields.has(StateField::dmhsta)) handle_.writer = graph.publish<BoolMessage>(node, "handle");
  if (fields.has(StateField::ain24))
    battery_.writer = graph.publish<BatteryMessage>(node, "battery");
  if (options.counts_per_turn || options.steps_per_turn) {
    joints_ = graph.publish<JointStateMessage>(node, "joint_states");
  }
  for (int n = 1; n <= encoder_channels; ++n) {
    for (const StateField first : {StateField::enc1, StateField::enc1hz}) {
      if (options.counts_per_turn && fields.has(nth(first, n))) joint_fields_.add(nth(first, n));
    }
  }
  for (int n = 1; n <= stepper_channels; ++n) {
    if (options.steps_per_turn && fields.has(stepper_field(n))) joint_fields_.add(stepper_field(n));
  }
}

void BoardTopics::write_text(dds_entity_t writer, std::string_view text) {
  std::string bytes(text);
  StringMessage message{};
  message.data._length = message.data._maximum = static_cast<std::uint32_t>(bytes.size() + 1);
  message.data._buffer = reinterpret_cast<std::uint8_t*>(bytes.data());
  (void)dds_write(writer, &message);
}

template <class Message, class Value>
void BoardTopics::publish(Changing<Value>& topic, Value value, Clock::time_point now) {
  if (!topic.is_due(value, now)) return;
  Message message{};
  message.data = static_cast<decltype(message.data)>(value);
  (void)dds_write(topic.writer, &message);
}

void BoardTopics::on_datagram(const std::string& line) const { write_text(raw_, line); }

void BoardTopics::on_heartbeat() {
  write_text(heartbeat_, beat_ ? "True" : "False");
  beat_ = !beat_;
}

void BoardTopics::on_active(bool active) const { write_text(active_, active ? "True" : "False"); }

void BoardTopics::on_state(const State& state, WallTime sampled, std::uint32_t boot) {
  const Clock::time_point now = Clock::now();
  const FieldSet& has = state.present;
  for (int n = 1; n <= osmc_channels; ++n) {
    const auto i = static_cast<std::size_t>(n - 1);
    const auto duty = [](const auto& drive) {
      return static_cast<float>(to_duty(drive.pwm, drive.direction));
    };
    if (has.has(osmc_field(n))) publish<Float32Message>(osmc_[i], duty(state.raw.osmc[i]), now);
    if (has.has(dhb12_field(n))) publish<Float32Message>(dhb12_[i], duty(state.raw.dhb12[i]), now);
    if (has.has(nth(StateField::bldc1, n))) {
      const Bldc& bldc = state.raw.bldc[i];
      publish<Float32Message>(bldc_[i], static_cast<float>(to_duty(bldc.speed, bldc.direction)),
                              now);
    }
    if (has.has(nth(StateField::enc1, n)))
      publish<Int32Message>(encoders_[i], state.encoder(n), now);
    if (has.has(stepper_field(n))) publish<Int32Message>(steppers_[i], state.steps(n), now);
  }
  for (int n = 1; n <= servo_channels; ++n) {
    const auto i = static_cast<std::size_t>(n - 1);
    if (!has.has(servo_field(n))) continue;
    // Compared as a pulse: what is off is no number, and those are never equal.
    auto& topic = servos_[i];
    const auto pulse = static_cast<float>(state.raw.servo_us[i]);
    if (!topic.is_due(pulse, now)) continue;
    Float32Message message{};
    message.data = static_cast<float>(from_pulse(options_.servo, state.raw.servo_us[i]));
    (void)dds_write(topic.writer, &message);
  }
  for (std::size_t i = 0; i < analog_.size(); ++i) {
    if (!has.has(analog_topics[i].field)) continue;
    publish<Float32Message>(analog_[i], static_cast<float>(state.volts(static_cast<Analog>(i))),
                            now);
  }
  if (has.has(StateField::relays)) {
    publish<UInt32Message>(relays_, static_cast<std::uint32_t>(state.relays), now);
  }
  if (has.has(StateField::dmhsta)) publish<BoolMessage>(handle_, state.handle_held, now);
  publish_battery(state, sampled, now);
  publish_ranges(state, sampled, now);
  gather_joints(state, sampled, boot);
}

void BoardTopics::publish_battery(const State& state, WallTime sampled, Clock::time_point now) {
  const std::int32_t centivolts = state.raw.analog_cv[static_cast<int>(Analog::ain24)];
  if (!state.present.has(StateField::ain24) || !battery_.is_due(centivolts, now)) return;
  std::string none;
  BatteryMessage message{};
  message.header.stamp = stamp(sampled);
  message.header.frame_id = borrowed(none);
  message.voltage = static_cast<float>(centivolts) / 100;
  for (float* value : {&message.temperature, &message.current, &message.charge, &message.capacity,
                       &message.design_capacity, &message.percentage}) {
    *value = unknown;
  }
  message.present = true;
  message.location = borrowed(none);
  message.serial_number = borrowed(none);
  (void)dds_write(battery_.writer, &message);
}

void BoardTopics::publish_ranges(const State& state, WallTime sampled, Clock::time_point now) {
  constexpr std::uint8_t ultrasound = 0;
  for (int n = 1; n <= ultrasonic_channels; ++n) {
    auto& topic = ranges_[static_cast<std::size_t>(n - 1)];
    const std::uint16_t cm = state.distance_cm(n);
    if (!state.present.has(nth(StateField::us1, n)) || !topic.is_due(cm, now)) continue;
    const std::string frame = fmt::format("{}us{}", frame_prefix_, n);
    RangeMessage message{};
    message.header.stamp = stamp(sampled);
    message.header.frame_id = borrowed(frame);
    message.radiation_type = ultrasound;
    message.field_of_view = 0.26F;  // the HC-SR04's 15 degrees
    message.min_range = 0.02F;
    message.max_range = proximity_max_cm / 100.0F;
    // No echo is nothing within reach: REP 117.
    message.range = cm == 0 ? std::numeric_limits<float>::infinity() : cm / 100.0F;
    (void)dds_write(topic.writer, &message);
  }
}

void BoardTopics::gather_joints(const State& state, WallTime sampled, std::uint32_t boot) {
  if (joints_ == 0) return;
  if (gathered_ && gathered_->state.t_ms != state.t_ms) publish_joints();  // a part was lost
  if (!gathered_) gathered_ = Joints{{}, {}, sampled, boot};
  gathered_->state = state;  // the values of its other parts are still there
  bool all = true;
  for (int i = 0; i < state_field_count; ++i) {
    const auto field = static_cast<StateField>(i);
    if (!joint_fields_.has(field)) continue;
    if (state.present.has(field)) gathered_->present.add(field);
    all = all && gathered_->present.has(field);
  }
  if (all) publish_joints();
}

void BoardTopics::publish_joints() {
  const Joints joints = *gathered_;
  gathered_.reset();
  std::vector<std::string> names;
  std::vector<double> positions;
  std::vector<double> velocities;
  constexpr double turn = 2 * std::numbers::pi;
  for (int n = 1; n <= encoder_channels; ++n) {
    if (!joints.present.has(nth(StateField::enc1, n))) continue;
    const double scale = turn / *options_.counts_per_turn;
    names.push_back(fmt::format("encoder{}", n));
    Position& position = encoder_positions_[static_cast<std::size_t>(n - 1)];
    const auto counts = position.advance(joints.state.encoder(n), joints.boot);
    positions.push_back(static_cast<double>(counts) * scale);
    velocities.push_back(joints.present.has(nth(StateField::enc1hz, n))
                             ? joints.state.encoder_hz(n) * scale
                             : std::numeric_limits<double>::quiet_NaN());
  }
  for (int n = 1; n <= stepper_channels; ++n) {
    if (!joints.present.has(stepper_field(n))) continue;
    names.push_back(fmt::format("stepper{}", n));
    Position& position = stepper_positions_[static_cast<std::size_t>(n - 1)];
    const auto steps = position.advance(joints.state.steps(n), joints.boot);
    positions.push_back(static_cast<double>(steps) * turn / *options_.steps_per_turn);
    velocities.push_back(std::numeric_limits<double>::quiet_NaN());
  }
  if (names.empty()) return;
  std::string none;
  std::vector<char*> texts;
  texts.reserve(names.size());
  for (const std::string& name : names) texts.push_back(borrowed(name));
  JointStateMessage message{};
  message.header.stamp = stamp(joints.sampled);
  message.header.frame_id = borrowed(none);
  point(message.name, texts);
  point(message.position, positions);
  point(message.velocity, velocities);
  (void)dds_write(joints_, &message);
}

void BoardTopics::on_health(const Health& health, WallTime now) const {
  using Status = diagnostic_msgs_msg_dds__DiagnosticStatus_;
  using KeyValue = diagnostic_msgs_msg_dds__KeyValue_;
  std::vector<KeyValue> values;
  for (const auto& [key, value] : health.values) values.push_back({borrowed(key), borrowed(value)});
  const std::string name = node_name_ + ": board";
  Status status{};
  status.level = health.level;
  status.name = borrowed(name);
  status.message = borrowed(health.message);
  status.hardware_id = borrowed(health.hardware_id);
  point(status.values, values);
  std::string none;
  DiagnosticsMessage message{};
  message.header.stamp = stamp(now);
  message.header.frame_id = borrowed(none);
  message.status._length = message.status._maximum = 1;
  message.status._buffer = &status;
  (void)dds_write(diagnostics_, &message);
}

void BoardTopics::log(LogLevel level, const std::string& text, WallTime now) const {
  std::string none;
  // A logger is called as its node, with dots.
  std::string logger = node_name_.substr(1);
  std::replace(logger.begin(), logger.end(), '/', '.');
  LogMessage message{};
  message.stamp = stamp(now);
  message.level = static_cast<std::uint8_t>(level);
  message.name = borrowed(logger);
  message.msg = borrowed(text);
  message.file = borrowed(none);
  message.function = borrowed(none);
  (void)dds_write(rosout_, &message);
}

}  // namespace r4::tool::ros2
