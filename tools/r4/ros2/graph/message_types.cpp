// SPDX-License-Identifier: GPL-3.0-or-later
#include "message_types.hpp"

#include <fmt/format.h>

namespace r4::tool::ros2 {
namespace {

dds_topic_descriptor_t renamed(const dds_topic_descriptor_t& type, const char* name) noexcept {
  return {type.m_size, type.m_align, type.m_flagset, type.m_nkeys,
          name,        type.m_keys,  type.m_nops,    type.m_ops,
          type.m_meta, {nullptr, 0}, {nullptr, 0},   type.restrict_data_representation};
}

// The older messages, under the name used in every release.
const dds_topic_descriptor_t nodes_before_iron =
    renamed(rmw_dds_common_before_iron_msg_dds__ParticipantEntitiesInfo__desc,
            rmw_dds_common_msg_dds__ParticipantEntitiesInfo__desc.m_typename);

}  // namespace

std::string user_data_of(const MessageType& type) {
  return *type.hash == '\0' ? std::string() : fmt::format("typehash={};", type.hash);
}

#define R4_MESSAGE_TYPE(Message, name, hash, descriptor)   \
  template <>                                              \
  const MessageType& message_type<Message>() {             \
    static const MessageType type{name, hash, descriptor}; \
    return type;                                           \
  }

R4_MESSAGE_TYPE(StringMessage, "std_msgs/msg/String",
                "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
                &std_msgs_msg_dds__String__desc)
R4_MESSAGE_TYPE(BoolMessage, "std_msgs/msg/Bool",
                "RIHS01_feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9",
                &std_msgs_msg_dds__Bool__desc)
R4_MESSAGE_TYPE(Float32Message, "std_msgs/msg/Float32",
                "RIHS01_7170d3d8f841f7be3172ce5f4f59f3a4d7f63b0447e8b33327601ad64d83d6e2",
                &std_msgs_msg_dds__Float32__desc)
R4_MESSAGE_TYPE(Int32Message, "std_msgs/msg/Int32",
                "RIHS01_b6578ded3c58c626cfe8d1a6fb6e04f706f97e9f03d2727c9ff4e74b1cef0deb",
                &std_msgs_msg_dds__Int32__desc)
R4_MESSAGE_TYPE(UInt32Message, "std_msgs/msg/UInt32",
                "RIHS01_a5c874829b752bc5fa190024b0ad76f578cc278271e855c7d02a818b3516fb4a",
                &std_msgs_msg_dds__UInt32__desc)
R4_MESSAGE_TYPE(TwistMessage, "geometry_msgs/msg/Twist",
                "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",
                &geometry_msgs_msg_dds__Twist__desc)
R4_MESSAGE_TYPE(TwistStampedMessage, "geometry_msgs/msg/TwistStamped",
                "RIHS01_5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64",
                &geometry_msgs_msg_dds__TwistStamped__desc)
R4_MESSAGE_TYPE(BatteryMessage, "sensor_msgs/msg/BatteryState",
                "RIHS01_4bee5dfce981c98faa6828b868307a0a73f992ed0789f374ee96c8f840e69741",
                &sensor_msgs_msg_dds__BatteryState__desc)
R4_MESSAGE_TYPE(JointStateMessage, "sensor_msgs/msg/JointState",
                "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
                &sensor_msgs_msg_dds__JointState__desc)
R4_MESSAGE_TYPE(ImuMessage, "sensor_msgs/msg/Imu",
                "RIHS01_7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b",
                &sensor_msgs_msg_dds__Imu__desc)
R4_MESSAGE_TYPE(RangeMessage, "sensor_msgs/msg/Range",
                "RIHS01_b42b62562e93cbfe9d42b82fe5994dfa3d63d7d5c90a317981703f7388adff3a",
                &sensor_msgs_msg_dds__Range__desc)
R4_MESSAGE_TYPE(DiagnosticsMessage, "diagnostic_msgs/msg/DiagnosticArray",
                "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
                &diagnostic_msgs_msg_dds__DiagnosticArray__desc)
R4_MESSAGE_TYPE(LogMessage, "rcl_interfaces/msg/Log",
                "RIHS01_e28ce254ca8abc06abf92773b74602cdbf116ed34fbaf294fb9f81da9f318eac",
                &rcl_interfaces_msg_dds__Log__desc)
R4_MESSAGE_TYPE(TriggerRequest, "std_srvs/srv/Trigger_Request",
                "RIHS01_d010825374ce8918e72bfd826c82603e60f45419e932ea976f807b74a863a199",
                &std_srvs_srv_dds__Trigger_Request__desc)
R4_MESSAGE_TYPE(TriggerResponse, "std_srvs/srv/Trigger_Response",
                "RIHS01_2d946c21e2fc3f1e9ca6986a8191d85fcc70097a8bb7771a053564bc47009cdf",
                &std_srvs_srv_dds__Trigger_Response__desc)
R4_MESSAGE_TYPE(AddDiagnosticsRequest, "diagnostic_msgs/srv/AddDiagnostics_Request",
                "RIHS01_e0b6572a07c2b3ca2c4f2acf742297661f6ceb50f5baa4f9305b6094cf950146",
                &diagnostic_msgs_srv_dds__AddDiagnostics_Request__desc)
R4_MESSAGE_TYPE(AddDiagnosticsResponse, "diagnostic_msgs/srv/AddDiagnostics_Response",
                "RIHS01_e7070a2373c892c4cf071dcd90405d7696187eb2ff0e40d8b6472a04a4b73d22",
                &diagnostic_msgs_srv_dds__AddDiagnostics_Response__desc)
R4_MESSAGE_TYPE(NodesMessage, "rmw_dds_common/msg/ParticipantEntitiesInfo",
                "RIHS01_91a0593bacdcc50ea9bdcf849a938b128412cc1ea821245c663bcd26f83c295e",
                &rmw_dds_common_msg_dds__ParticipantEntitiesInfo__desc)
R4_MESSAGE_TYPE(NodesBeforeIronMessage, "rmw_dds_common/msg/ParticipantEntitiesInfo", "",
                &nodes_before_iron)

#undef R4_MESSAGE_TYPE

}  // namespace r4::tool::ros2
