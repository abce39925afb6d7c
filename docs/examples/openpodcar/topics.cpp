// SPDX-License-Identifier: GPL-3.0-or-later
#include "topics.hpp"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <r4link/error.hpp>
#include <string>
#include <string_view>

#include "podcar_ros2.h"

namespace {

using Time = Pilot::Time;

// While the board is armed, at most this many messages wait: the newest, of three seconds while
// no stick moves, of less time while a stick moves, because joy_node publishes each change.
constexpr int most_joys = 64;
constexpr const char* this_computer =
    R"(<Interfaces><NetworkInterface name="lo" multicast="true"/></Interfaces>)"
    "<AllowMulticast>spdp</AllowMulticast>";

std::string_view environment(const char* name) {
  const char* const value = std::getenv(name);
  return value == nullptr ? "" : value;
}

dds_domainid_t domain_id() {
  const std::string_view text = environment("ROS_DOMAIN_ID");
  dds_domainid_t id = 0;
  const auto [end, error] = std::from_chars(text.begin(), text.end(), id);
  if (!text.empty() && (error != std::errc() || end != text.end() || id > 232)) {
    throw r4::Error(r4::ErrorKind::usage, "ROS_DOMAIN_ID", "it is not a domain",
                    "set it to a number from 0 to 232");
  }
  return id;
}

// Cyclone's configuration. Fast DDS needs GenerateKeyhash to notice a publisher that leaves.
std::string configuration() {
  const bool network = environment("ROS_AUTOMATIC_DISCOVERY_RANGE") == "SUBNET";
  return std::string("<CycloneDDS><Domain><General>") + (network ? "" : this_computer) +
         "</General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
         "<MaxAutoParticipantIndex>99</MaxAutoParticipantIndex>" +
         (network ? "" : R"(<Peers><Peer Address="127.0.0.1"/></Peers>)") +
         "</Discovery><Internal><GenerateKeyhash>true</GenerateKeyhash></Internal>"
         "</Domain></CycloneDDS>";
}

dds_entity_t made(dds_entity_t entity, const char* what) {
  if (entity >= 0) return entity;
  throw r4::Error(r4::ErrorKind::open, what, dds_strretcode(-entity),
                  "look at CYCLONEDDS_URI, and that the network interface is up");
}

struct Topic {
  const char* name;
  const dds_topic_descriptor_t* type;
  const char* hash;  // RIHS01 of the type: ROS compares it from Iron on (REP 2016)
};
const Topic joy_topic{"rt/joy", &sensor_msgs_msg_dds__Joy__desc,
                      "0d356c79cad3401e35ffeb75a96a96e08be3ef896b8b83841d73e890989372c5"};
const Topic cmd_vel_topic{"rt/cmd_vel", &geometry_msgs_msg_dds__Twist__desc,
                          "9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a"};
const Topic goal_pose_topic{"rt/goal_pose", &geometry_msgs_msg_dds__PoseStamped__desc,
                            "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8"};
const Topic odom_topic{"rt/odom", &nav_msgs_msg_dds__Odometry__desc,
                       "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"};

using Qos = std::unique_ptr<dds_qos_t, decltype(&dds_delete_qos)>;

Qos qos_with(const std::string& user_data) {
  Qos qos(dds_create_qos(), dds_delete_qos);
  dds_qset_userdata(qos.get(), user_data.data(), user_data.size());
  return qos;
}

// ROS 2 writes XCDR1. A write never waits for a slow reader.
Qos qos_of(const Topic& topic, dds_reliability_kind_t reliability, int depth) {
  Qos qos = qos_with(std::string("typehash=RIHS01_") + topic.hash + ";");
  constexpr dds_data_representation_id_t xcdr1 = DDS_DATA_REPRESENTATION_XCDR1;
  dds_qset_data_representation(qos.get(), 1, &xcdr1);
  dds_qset_reliability(qos.get(), reliability, 0);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, depth);
  return qos;
}

// Calls use(message, publisher) for each waiting message. Returns the number of messages.
template <class Message, class Use>
int take_each(dds_entity_t reader, const Use& use) {
  void* samples[most_joys] = {};
  dds_sample_info_t infos[most_joys];
  const int count = dds_take(reader, samples, infos, most_joys, most_joys);
  for (int i = 0; i < count; ++i) {
    if (!infos[i].valid_data) continue;
    use(*static_cast<const Message*>(samples[i]), infos[i].publication_handle);
  }
  if (count > 0) dds_return_loan(reader, samples, count);
  return count;
}

}  // namespace

Topics::Topics() {
  const dds_domainid_t id = domain_id();
  if (environment("CYCLONEDDS_URI").empty()) {
    domain_ = made(dds_create_domain(id, configuration().c_str()), "the ROS domain");
  }
  const Qos ours = qos_with("enclave=/;");  // marks a participant of ROS 2
  participant_ = made(dds_create_participant(id, ours.get(), nullptr), "the ROS domain");

  const auto created = [&](const Topic& topic) {
    return made(dds_create_topic(participant_, topic.type, topic.name, nullptr, nullptr),
                topic.name);
  };
  const auto reader = [&](const Topic& topic, dds_reliability_kind_t reliability, int depth) {
    const Qos qos = qos_of(topic, reliability, depth);
    return made(dds_create_reader(participant_, created(topic), qos.get(), nullptr), topic.name);
  };
  // /joy and /cmd_vel need no repetition, because a newer message follows. A goal is sent only
  // once, so it must be reliable.
  joy_ = reader(joy_topic, DDS_RELIABILITY_BEST_EFFORT, most_joys);
  cmd_vel_ = reader(cmd_vel_topic, DDS_RELIABILITY_BEST_EFFORT, 1);
  goal_pose_ = reader(goal_pose_topic, DDS_RELIABILITY_RELIABLE, 1);
  const Qos qos = qos_of(odom_topic, DDS_RELIABILITY_RELIABLE, 1);
  odom_ = made(dds_create_writer(participant_, created(odom_topic), qos.get(), nullptr),
               odom_topic.name);
}

Topics::~Topics() {
  dds_delete(participant_);
  if (domain_ != 0) dds_delete(domain_);
}

void Topics::take(Pilot& pilot, const r4::control::Pose& pose) {
  const Time now = std::chrono::steady_clock::now();
  const int joys = take_each<sensor_msgs_msg_dds__Joy_>(
      joy_, [&](const sensor_msgs_msg_dds__Joy_& joy, std::uint64_t publisher) {
        pilot.on_joy({joy.axes._buffer, joy.axes._length},
                     {joy.buttons._buffer, joy.buttons._length}, now, publisher);
      });
  if (joys == most_joys) pilot.end("so much of /joy has waited that a stop may be lost");
  take_each<geometry_msgs_msg_dds__Twist_>(
      cmd_vel_, [&](const geometry_msgs_msg_dds__Twist_& twist, std::uint64_t) {
        pilot.on_cmd_vel({twist.linear.x, twist.angular.z}, now);
      });
  take_each<geometry_msgs_msg_dds__PoseStamped_>(
      goal_pose_, [&](const geometry_msgs_msg_dds__PoseStamped_& goal, std::uint64_t) {
        const Waypoint place{goal.pose.position.x, goal.pose.position.y};
        const std::string refused = std::strcmp(goal.header.frame_id, "odom") == 0
                                        ? pilot.on_goal(place, pose, now)
                                        : "it is not in the frame odom";
        std::printf("goal %.2f, %.2f%s%s\n", place.x_m, place.y_m, refused.empty() ? "" : ": ",
                    refused.c_str());
      });
}

void Topics::publish(const Podcar& podcar, const r4::ReceivedState& state) {
  using namespace std::chrono;
  static char odom[] = "odom", base_link[] = "base_link";
  const auto sampled = state.sampled_at_wall_time().time_since_epoch();
  const auto whole_s = floor<seconds>(sampled);
  const r4::control::Pose& pose = podcar.pose();

  nav_msgs_msg_dds__Odometry_ message{};
  message.header.stamp.sec = static_cast<std::int32_t>(whole_s.count());
  message.header.stamp.nanosec =
      static_cast<std::uint32_t>(duration_cast<nanoseconds>(sampled - whole_s).count());
  message.header.frame_id = odom;
  message.child_frame_id = base_link;
  message.pose.pose.position = {pose.x_m, pose.y_m, 0};
  message.pose.pose.orientation = {0, 0, std::sin(pose.yaw_rad / 2), std::cos(pose.yaw_rad / 2)};
  const auto covariance = podcar.odometry().ros_covariance();
  std::copy(covariance.begin(), covariance.end(), message.pose.covariance);
  message.twist.twist.linear.x = podcar.speed_m_s();
  message.twist.twist.angular.z = podcar.turn_rad_s();
  dds_write(odom_, &message);  // a failed write is harmless: the next state follows
}
