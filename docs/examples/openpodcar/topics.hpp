// SPDX-License-Identifier: GPL-3.0-or-later
// The vehicle's topics in a ROS 2 graph, through Cyclone DDS without ROS. Every program in the
// graph may drive. Unless ROS_AUTOMATIC_DISCOVERY_RANGE is SUBNET or CYCLONEDDS_URI has other
// interfaces, the graph is limited to this computer. ROS_DOMAIN_ID is the number of the graph.
//
// No thread of DDS calls this class: messages wait in the readers until take().
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

  // Gives the pilot the messages since the last call: /joy, /cmd_vel and /goal_pose. Does not wait.
  void take(Pilot& pilot, const r4::control::Pose& pose);
  // Publishes /odom for this state. Does not wait.
  void publish(const Podcar& podcar, const r4::ReceivedState& state);

 private:
  dds_entity_t domain_ = 0;
  dds_entity_t participant_ = 0;
  dds_entity_t joy_ = 0;
  dds_entity_t cmd_vel_ = 0;
  dds_entity_t goal_pose_ = 0;
  dds_entity_t odom_ = 0;
};
