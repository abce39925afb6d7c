// SPDX-License-Identifier: GPL-3.0-or-later
// The vehicle's topics in a ROS 2 graph, by Cyclone DDS alone. Whoever is in the graph may drive: it is this computer,
// unless ROS_AUTOMATIC_DISCOVERY_RANGE is SUBNET, or CYCLONEDDS_URI says something else; its number is ROS_DOMAIN_ID.
//
// No thread of DDS calls anything here: what has come waits in its readers until take().
#pragma once

#include <dds/dds.h>

#include <r4link/link.hpp>

#include "pilot.hpp"
#include "podcar.hpp"

class Topics {
 public:
  // Throws r4::Error if there is no such graph.
  Topics();
  ~Topics();
  Topics(const Topics&) = delete;
  Topics& operator=(const Topics&) = delete;

  // What has come since the last call, to the pilot: /joy, /cmd_vel and /goal_pose. Does not wait.
  void take(Pilot& pilot, const r4::control::Pose& pose);
  // /odom, of this state. Does not wait.
  void publish(const Podcar& podcar, const r4::ReceivedState& state);

 private:
  dds_entity_t domain_ = 0;
  dds_entity_t participant_ = 0;
  dds_entity_t joy_ = 0;
  dds_entity_t cmd_vel_ = 0;
  dds_entity_t goal_pose_ = 0;
  dds_entity_t odom_ = 0;
};
