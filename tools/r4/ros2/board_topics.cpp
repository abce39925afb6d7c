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
  for (const StateField field : fields) {
    const StateFieldRow& row = row_of(field);
    components_[static_cast<std::size_t>(field)].writer = make_topic(graph, node, row);
    const bool is_of_encoder = row.kind == FieldKind::encoder || row.kind == FieldKind::encoder_hz;
    if ((is_of_encoder && options.counts_per_turn) ||
        (row.kind == FieldKind::stepper && options.steps_per_turn)) {
      joint_fields_.add(field);
    }
  }
  if (fields.has(StateField::ain24))
    battery_.writer = graph.publish<BatteryMessage>(node, "battery");
  if (options.counts_per_turn || options.steps_per_turn) {
    joints_ = graph.publish<JointStateMessage>(node, "joint_states");
  }
}

dds_entity_t BoardTopics::make_topic(Graph& graph, std::size_t node, const StateFieldRow& row) {
  const char* const kind = row_of(row.kind).name;
  switch (row.kind) {
    case FieldKind::dhb12:
      return graph.publish<Float32Message>(node, fmt::format("{}_{}/state", kind, row.channel));
    case FieldKind::osmc:
    case FieldKind::bldc:
    case FieldKind::servo:
      return graph.publish<Float32Message>(node, fmt::format("{}{}/state", kind, row.channel));
    case FieldKind::stepper:
      return graph.publish<Int32Message>(node, fmt::format("{}{}/state", kind, row.channel));
    case FieldKind::encoder:
      return graph.publish<Int32Message>(node, fmt::format("{}{}", kind, row.channel));
    case FieldKind::ultrasonic:
      return graph.publish<RangeMessage>(node, fmt::format("range/us{}", row.channel));
    case FieldKind::analog: {
      std::string input(row.name.data(), row.name.size());
      for (char& c : input) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
      return graph.publish<Float32Message>(node, "analog/" + input);
    }
    case FieldKind::relays:
      return graph.publish<UInt32Message>(node, kind);
    case FieldKind::handle:
      return graph.publish<BoolMessage>(node, kind);
    default:
      return 0;
  }
}

void BoardTopics::write_text(dds_entity_t writer, std::string_view text) {
  std::string bytes(text);
  StringMessage message{};
  message.data._length = message.data._maximum = static_cast<std::uint32_t>(bytes.size() + 1);
  message.data._buffer = reinterpret_cast<std::uint8_t*>(bytes.data());
  (void)dds_write(writer, &message);
}

template <class Message>
void BoardTopics::publish(StateField field, double value, Clock::time_point now) {
  Changing<double>& topic = components_[static_cast<std::size_t>(field)];
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
  for (const StateField field : state.present) {
    const StateNumbers numbers = numbers_of(state, field);
    switch (row_of(field).kind) {
      case FieldKind::osmc:
      case FieldKind::dhb12:
      case FieldKind::bldc:
        publish<Float32Message>(
            field, to_duty(static_cast<int>(numbers[0]), static_cast<Direction>(numbers[1])), now);
        break;
      case FieldKind::servo:
        publish_pulse(field, static_cast<int>(numbers[0]), now);
        break;
      case FieldKind::analog:
        publish<Float32Message>(field, numbers[0], now);
        break;
      case FieldKind::encoder:
      case FieldKind::stepper:
        publish<Int32Message>(field, numbers[0], now);
        break;
      case FieldKind::ultrasonic:
        publish_range(field, numbers[0], sampled, now);
        break;
      case FieldKind::relays:
        publish<UInt32Message>(field, numbers[0], now);
        break;
      case FieldKind::handle:
        publish<BoolMessage>(field, numbers[0], now);
        break;
      default:
        break;
    }
  }
  publish_battery(state, sampled, now);
  gather_joints(state, sampled, boot);
}

// Compares pulses: the position of a disabled servo is NaN, which never equals itself.
void BoardTopics::publish_pulse(StateField servo, int pulse_us, Clock::time_point now) {
  Changing<double>& topic = components_[static_cast<std::size_t>(servo)];
  if (!topic.is_due(pulse_us, now)) return;
  Float32Message message{};
  message.data = static_cast<float>(from_pulse(options_.servo, pulse_us));
  (void)dds_write(topic.writer, &message);
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

void BoardTopics::publish_range(StateField sensor, double cm, WallTime sampled,
                                Clock::time_point now) {
  constexpr std::uint8_t ultrasound = 0;
  Changing<double>& topic = components_[static_cast<std::size_t>(sensor)];
  if (!topic.is_due(cm, now)) return;
  const std::string frame = fmt::format("{}us{}", frame_prefix_, row_of(sensor).channel);
  RangeMessage message{};
  message.header.stamp = stamp(sampled);
  message.header.frame_id = borrowed(frame);
  message.radiation_type = ultrasound;
  message.field_of_view = 0.26F;  // the HC-SR04's 15 degrees
  message.min_range = 0.02F;
  message.max_range = proximity_max_cm / 100.0F;
  // No echo means nothing within reach (REP 117).
  message.range =
      cm == 0 ? std::numeric_limits<float>::infinity() : static_cast<float>(cm) / 100.0F;
  (void)dds_write(topic.writer, &message);
}

void BoardTopics::gather_joints(const State& state, WallTime sampled, std::uint32_t boot) {
  if (joints_ == 0) return;
  if (gathered_ && gathered_->state.t_ms != state.t_ms) publish_joints();  // a part was lost
  if (!gathered_) gathered_ = Joints{{}, {}, sampled, boot};
  gathered_->state = state;
  bool all = true;
  for (const StateField field : joint_fields_) {
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
    if (!joints.present.has(state_field(FieldKind::encoder, n))) continue;
    const double scale = turn / *options_.counts_per_turn;
    names.push_back(fmt::format("encoder{}", n));
    Position& position = encoder_positions_[static_cast<std::size_t>(n - 1)];
    const auto counts = position.advance(joints.state.encoder(n), joints.boot);
    positions.push_back(static_cast<double>(counts) * scale);
    velocities.push_back(joints.present.has(state_field(FieldKind::encoder_hz, n))
                             ? joints.state.encoder_hz(n) * scale
                             : std::numeric_limits<double>::quiet_NaN());
  }
  for (int n = 1; n <= stepper_channels; ++n) {
    if (!joints.present.has(state_field(FieldKind::stepper, n))) continue;
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
  // A logger has its node's name, with dots.
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
