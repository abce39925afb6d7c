// SPDX-License-Identifier: GPL-3.0-or-later
#include "entity.hpp"

#include <fmt/format.h>

#include <cstring>

#include "r4link/error.hpp"

namespace r4::tool::ros2 {

Entity::Entity(dds_entity_t made, const std::string& what) : entity_(made) {
  if (made >= 0) return;
  entity_ = 0;
  throw Error(ErrorKind::open, what, fmt::format("Cyclone DDS reports: {}", dds_strretcode(-made)),
              "check CYCLONEDDS_URI and the environment of ROS, and that the network interface is "
              "up (docs/how-to/ros2.md)");
}

void Entity::reset() {
  if (entity_ > 0) (void)dds_delete(std::exchange(entity_, 0));
}

EntityId id_from(const dds_guid_t& guid) {
  EntityId id{};
  std::memcpy(id.data(), guid.v, id.size());
  return id;
}

EntityId id_of(dds_entity_t entity) {
  dds_guid_t guid{};
  (void)dds_get_guid(entity, &guid);
  return id_from(guid);
}

QosPtr make_qos(const Qos& qos) {
  QosPtr made(dds_create_qos());
  constexpr dds_data_representation_id_t xcdr1 = DDS_DATA_REPRESENTATION_XCDR1;
  dds_qset_data_representation(made.get(), 1, &xcdr1);
  dds_qset_reliability(made.get(),
                       qos.reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT,
                       DDS_MSECS(100));
  dds_qset_history(made.get(), DDS_HISTORY_KEEP_LAST, qos.depth);
  if (qos.transient_local) {
    dds_qset_durability(made.get(), DDS_DURABILITY_TRANSIENT_LOCAL);
    // By default a late reader would get one sample only.
    dds_qset_durability_service(made.get(), 0, DDS_HISTORY_KEEP_LAST, qos.depth,
                                DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED);
  }
  if (qos.lifespan != DDS_INFINITY) dds_qset_lifespan(made.get(), qos.lifespan);
  if (!qos.user_data.empty()) {
    dds_qset_userdata(made.get(), qos.user_data.data(), qos.user_data.size());
  }
  return made;
}

std::string user_data_of(const dds_qos_t* qos) {
  void* bytes = nullptr;
  std::size_t size = 0;
  if (qos == nullptr || !dds_qget_userdata(qos, &bytes, &size) || bytes == nullptr) return {};
  std::string text(static_cast<const char*>(bytes), size);
  dds_free(bytes);
  return text;
}

}  // namespace r4::tool::ros2
