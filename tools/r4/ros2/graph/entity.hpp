// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <dds/dds.h>

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

namespace r4::tool::ros2 {

class Entity {
 public:
  Entity() = default;
  // Throws Error{open} naming `what` if creation failed.
  Entity(dds_entity_t made, const std::string& what);
  ~Entity() { reset(); }
  Entity(Entity&& other) noexcept : entity_(std::exchange(other.entity_, 0)) {}
  Entity& operator=(Entity&& other) noexcept {
    if (this != &other) {
      reset();
      entity_ = std::exchange(other.entity_, 0);
    }
    return *this;
  }
  Entity(const Entity&) = delete;
  Entity& operator=(const Entity&) = delete;

  dds_entity_t get() const { return entity_; }
  void reset();

 private:
  dds_entity_t entity_ = 0;
};

using EntityId = std::array<std::uint8_t, 16>;
EntityId id_from(const dds_guid_t& guid);
EntityId id_of(dds_entity_t entity);

struct Qos {
  int depth = 10;
  bool reliable = true;          // the default of ROS; an unreliable reader accepts all writers
  bool transient_local = false;  // late readers get the kept samples
  dds_duration_t lifespan = DDS_INFINITY;
  std::string user_data;
};

struct DeleteQos {
  void operator()(dds_qos_t* qos) const { dds_delete_qos(qos); }
};
using QosPtr = std::unique_ptr<dds_qos_t, DeleteQos>;

// A write waits for a slow reader for at most 100 ms.
QosPtr make_qos(const Qos& qos);

std::string user_data_of(const dds_qos_t* qos);

}  // namespace r4::tool::ros2
