// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <dds/dds.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "entity.hpp"

namespace r4::tool::ros2 {

enum class EndpointKind : std::uint8_t { reader, writer };

struct Policies {
  bool reliable = true;
  dds_durability_kind_t durability = DDS_DURABILITY_VOLATILE;
  dds_duration_t deadline = DDS_INFINITY;
  dds_liveliness_kind_t liveliness = DDS_LIVELINESS_AUTOMATIC;
  dds_duration_t lease = DDS_INFINITY;
  bool xcdr1 = true;  // the writer uses XCDR1, or the reader accepts it
};
Policies policies_of(EndpointKind kind, const dds_qos_t* qos);
// The first policy of which less is offered than requested, in words; nullptr if they match.
const char* unmatched_policy(const Policies& offered, const Policies& requested);

struct Announced {
  EndpointKind kind = EndpointKind::writer;
  EntityId id{};
  bool gone = false;  // if true, the members below are unknown
  std::string topic;  // DDS name: "rt/R4"
  std::string type;   // DDS name: "std_msgs::msg::dds_::String_"
  std::string user_data;
  std::string owner;  // printable: "process 1234 on robot"; empty if unknown
  Policies policies;
  std::string owner_text() const { return owner.empty() ? "see ros2 topic info -v" : owner; }
};

struct Mismatch {
  enum class Weight : std::uint8_t {
    note,     // nothing is lost
    warning,  // samples are lost or misunderstood
    lost,     // commands are lost
  };
  Weight weight = Weight::warning;
  std::string text;  // begins with the node's name of the topic
};
// Called for a writer whose type differs from the topic's type. May create a reader for that type.
using OtherType = std::function<std::optional<Mismatch>(const Announced& writer)>;

// "std_msgs/msg/String" for "std_msgs::msg::dds_::String_". Any name becomes printable.
std::string ros_type(std::string_view dds_type);

}  // namespace r4::tool::ros2
