// SPDX-License-Identifier: GPL-3.0-or-later
#include "announced.hpp"

#include <algorithm>

#include "tools/r4/shell/json.hpp"

namespace r4::tool::ros2 {

Policies policies_of(EndpointKind kind, const dds_qos_t* qos) {
  Policies policies;
  dds_reliability_kind_t reliability = DDS_RELIABILITY_BEST_EFFORT;
  dds_duration_t blocking = 0;
  if (dds_qget_reliability(qos, &reliability, &blocking)) {
    policies.reliable = reliability == DDS_RELIABILITY_RELIABLE;
  }
  (void)dds_qget_durability(qos, &policies.durability);
  (void)dds_qget_deadline(qos, &policies.deadline);
  (void)dds_qget_liveliness(qos, &policies.liveliness, &policies.lease);
  std::uint32_t count = 0;
  dds_data_representation_id_t* ids = nullptr;
  if (dds_qget_data_representation(qos, &count, &ids) && count != 0) {
    if (kind == EndpointKind::writer) count = 1;  // a writer uses only the first
    policies.xcdr1 = std::find(ids, ids + count, DDS_DATA_REPRESENTATION_XCDR1) != ids + count;
  }
  dds_free(ids);
  return policies;
}

const char* unmatched_policy(const Policies& offered, const Policies& requested) {
  if (requested.reliable && !offered.reliable) return "reliability";
  if (requested.durability > offered.durability) return "durability";
  if (requested.deadline < offered.deadline) return "deadline";
  if (requested.liveliness > offered.liveliness || requested.lease < offered.lease) {
    return "liveliness";
  }
  return requested.xcdr1 && offered.xcdr1 ? nullptr : "XCDR1";
}

std::string ros_type(std::string_view dds_type) {
  constexpr std::string_view inner = "::dds_::";
  const std::size_t at = dds_type.find(inner);
  const bool is_ros = at != std::string_view::npos && dds_type.ends_with('_');
  if (!is_ros) return escaped(dds_type);
  std::string name =
      escaped(dds_type.substr(0, at)) + '/' +
      escaped(dds_type.substr(at + inner.size(), dds_type.size() - 1 - at - inner.size()));
  if (const std::size_t colons = name.find("::"); colons != std::string::npos) {
    name.replace(colons, 2, "/");
  }
  return name;
}

}  // namespace r4::tool::ros2
