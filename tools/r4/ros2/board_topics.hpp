// SPDX-License-Identifier: GPL-3.0-or-later
// The topics of a board: the paper's three strings (section 8.8), components in ROS units, joints,
// battery, ranges and diagnostics. After construction only the outbox's thread uses this object.
// The strings are published with every datagram, joints with every state. A component is published
// when it changes and once a second, for late subscribers. Missing fields are not repeated.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "graph/graph.hpp"
#include "graph/message_types.hpp"
#include "node_options.hpp"
#include "r4link/link.hpp"
#include "r4link/tables/state_fields.hpp"

namespace r4::tool::ros2 {

struct Health {
  enum Level : std::uint8_t { ok = 0, warning = 1, error = 2, stale = 3 };
  Level level = stale;
  std::string message;
  std::string hardware_id;
  std::vector<std::pair<std::string, std::string>> values;
};

class BoardTopics {
 public:
  using Clock = std::chrono::steady_clock;
  using WallTime = std::chrono::system_clock::time_point;

  BoardTopics(Graph& graph, std::size_t node, const NodeOptions& options);

  void on_datagram(const std::string& line) const;
  void on_heartbeat();
  void on_active(bool active) const;
  // `boot`: number of restarts of the board.
  void on_state(const State& state, WallTime sampled, std::uint32_t boot);
  void on_health(const Health& health, WallTime now) const;
  void log(LogLevel level, const std::string& text, WallTime now) const;

 private:
  template <class Value>
  struct Changing {
    dds_entity_t writer = 0;
    std::optional<Value> last;
    Clock::time_point sent{};
    bool is_due(const Value& value, Clock::time_point now) {
      if (writer == 0 || (last == value && now - sent < std::chrono::seconds(1))) return false;
      last = value;
      sent = now;
      return true;
    }
  };
  static dds_entity_t make_topic(Graph& graph, std::size_t node, const StateFieldRow& row);
  template <class Message>
  void publish(StateField field, double value, Clock::time_point now);
  void publish_battery(const State& state, WallTime sampled, Clock::time_point now);
  void publish_pulse(StateField servo, int pulse_us, Clock::time_point now);
  void publish_range(StateField sensor, double cm, WallTime sampled, Clock::time_point now);
  void gather_joints(const State& state, WallTime sampled, std::uint32_t boot);
  void publish_joints();
  static void write_text(dds_entity_t writer, std::string_view text);

  const NodeOptions options_;
  const std::string node_name_;
  const std::string frame_prefix_;
  bool beat_ = false;

  dds_entity_t raw_ = 0;
  dds_entity_t heartbeat_ = 0;
  dds_entity_t active_ = 0;
  dds_entity_t diagnostics_ = 0;
  dds_entity_t rosout_ = 0;
  dds_entity_t joints_ = 0;
  FieldSet joint_fields_;
  // A state may arrive as several datagrams with one T, which form one sample.
  struct Joints {
    State state;
    FieldSet present;
    WallTime sampled;
    std::uint32_t boot = 0;
  };
  std::optional<Joints> gathered_;
  std::array<Position, encoder_channels> encoder_positions_;
  std::array<Position, stepper_channels> stepper_positions_;
  std::array<Changing<double>, state_field_count> components_;  // by StateField
  Changing<std::int32_t> battery_;
};

}  // namespace r4::tool::ros2
