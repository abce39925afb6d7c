// SPDX-License-Identifier: GPL-3.0-or-later
// What a participant announces of one of its readers or writers, and whether two of them match.
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

// The policies of a reader or writer that DDS compares, and ROS lets its users choose.
struct Policies {
  bool reliable = true;
  dds_durability_kind_t durability = DDS_DURABILITY_VOLATILE;
  dds_duration_t deadline = DDS_INFINITY;
  dds_liveliness_kind_t liveliness = DDS_LIVELINESS_AUTOMATIC;
  dds_duration_t lease = DDS_INFINITY;
  bool xcdr1 = true;  // a writer writes it, a reader can read it
};
Policies policies_of(EndpointKind kind, const dds_qos_t* qos);
// The first policy of which a writer offers less than a reader requests, in words; nullptr if they
// match.
const char* unmatched_policy(const Policies& offered, const Policies& requested);

struct Announced {
  EndpointKind kind = EndpointKind::writer;
  EntityId id{};
  bool gone = false;  // nothing below is known then
  std::string topic;  // as DDS names it: "rt/R4"
  std::string type;   // as DDS names it: "std_msgs::msg::dds_::String_"
  std::string user_data;
  std::string owner;  // printable: "process 1234 on robot"; empty if its middleware does not say
  Policies policies;
  // Its owner, or how to find it.
  std::string owner_text() const { return owner.empty() ? "see ros2 topic info -v" : owner; }
};

// What is wrong between a reader or writer of another participant and ours.
struct Mismatch {
  enum class Weight : std::uint8_t {
    note,     // nothing is lost
    warning,  // samples are lost, or mean something else than their writer says
    lost,     // commands are lost
  };
  Weight weight = Weight::warning;
  std::string text;  // begins with the topic, as the node names it
};
// What becomes of a writer whose type our readers of its topic do not have. It may make a reader
// for it. Returns nothing if the type is simply wrong.
using OtherType = std::function<std::optional<Mismatch>(const Announced& writer)>;

// "std_msgs/msg/String" for "std_msgs::msg::dds_::String_". Any name becomes printable.
std::string ros_type(std::string_view dds_type);

}  // namespace r4::tool::ros2
