// SPDX-License-Identifier: GPL-3.0-or-later
// C++ names of the types in ros2_messages.idl, with their identification in DDS and ROS.
#pragma once

#include <dds/dds.h>
#include <ros2_messages.h>

#include <string>
#include <string_view>

namespace r4::tool::ros2 {

using TimeMessage = builtin_interfaces_msg_dds__Time_;
using StringMessage = std_msgs_msg_dds__String_;
using BoolMessage = std_msgs_msg_dds__Bool_;
using Float32Message = std_msgs_msg_dds__Float32_;
using Int32Message = std_msgs_msg_dds__Int32_;
using UInt32Message = std_msgs_msg_dds__UInt32_;
using TwistMessage = geometry_msgs_msg_dds__Twist_;
using TwistStampedMessage = geometry_msgs_msg_dds__TwistStamped_;
using BatteryMessage = sensor_msgs_msg_dds__BatteryState_;
using JointStateMessage = sensor_msgs_msg_dds__JointState_;
using ImuMessage = sensor_msgs_msg_dds__Imu_;
using RangeMessage = sensor_msgs_msg_dds__Range_;
using DiagnosticsMessage = diagnostic_msgs_msg_dds__DiagnosticArray_;
using LogMessage = rcl_interfaces_msg_dds__Log_;
using TriggerRequest = std_srvs_srv_dds__Trigger_Request_;
using TriggerResponse = std_srvs_srv_dds__Trigger_Response_;
using AddDiagnosticsRequest = diagnostic_msgs_srv_dds__AddDiagnostics_Request_;
using AddDiagnosticsResponse = diagnostic_msgs_srv_dds__AddDiagnostics_Response_;
using NodesMessage = rmw_dds_common_msg_dds__ParticipantEntitiesInfo_;
using NodesBeforeIronMessage = rmw_dds_common_before_iron_msg_dds__ParticipantEntitiesInfo_;

struct MessageType {
  const char* name;  // "std_msgs/msg/String"
  const char* hash;  // compared since Iron (REP 2011)
  const dds_topic_descriptor_t* descriptor;
};

template <class Message>
const MessageType& message_type();

template <>
const MessageType& message_type<StringMessage>();
template <>
const MessageType& message_type<BoolMessage>();
template <>
const MessageType& message_type<Float32Message>();
template <>
const MessageType& message_type<Int32Message>();
template <>
const MessageType& message_type<UInt32Message>();
template <>
const MessageType& message_type<TwistMessage>();
template <>
const MessageType& message_type<TwistStampedMessage>();
template <>
const MessageType& message_type<BatteryMessage>();
template <>
const MessageType& message_type<JointStateMessage>();
template <>
const MessageType& message_type<ImuMessage>();
template <>
const MessageType& message_type<RangeMessage>();
template <>
const MessageType& message_type<DiagnosticsMessage>();
template <>
const MessageType& message_type<LogMessage>();
template <>
const MessageType& message_type<TriggerRequest>();
template <>
const MessageType& message_type<TriggerResponse>();
template <>
const MessageType& message_type<AddDiagnosticsRequest>();
template <>
const MessageType& message_type<AddDiagnosticsResponse>();
template <>
const MessageType& message_type<NodesMessage>();
template <>
const MessageType& message_type<NodesBeforeIronMessage>();

// A text for a message, whose strings are not const. Valid while `string` exists.
inline char* borrowed(const std::string& string) { return const_cast<char*>(string.c_str()); }

inline std::string_view bytes_of(const dds_sequence_octet& string) {
  return {reinterpret_cast<const char*>(string._buffer), string._length};
}

std::string user_data_of(const MessageType& type);

}  // namespace r4::tool::ros2
