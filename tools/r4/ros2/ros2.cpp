// SPDX-License-Identifier: GPL-3.0-or-later
#include <memory>

#include "../shell/key_file.hpp"
#include "../shell/options.hpp"
#include "../shell/subcommands.hpp"
#include "bridge.hpp"

namespace r4::tool {
namespace {

constexpr const char* footer =
    R"(Joins the ROS 2 graph as the node /r4, even if ROS is not installed: the paper's topics R4,
R4_Heart_Beat, R4_Active and R4_Command (std_msgs/String), a topic for each component, diagnostics,
and the services ~/stop, ~/clear, ~/arm and ~/send (for clients with rmw_cyclonedds).
docs/how-to/ros2.md lists the topics with their units, and shows how to drive a robot with cmd_vel.

Outputs stay off until the board is armed: once by --arm, when the board is found; by true on the
topic arm; or by the service ~/arm. After a stop or a fault, arm again. If the stop or the fault
came before this program began, clear it first: by ~/clear, or by E:CLEAR on R4_Command. The outputs
of a publisher are switched off when it disappears, or is silent for --deadline. With several
boards, each board has a namespace: board1, board2 …, or the numbers of a pattern.

ROS_DOMAIN_ID selects the graph. The graph is limited to this computer, unless
ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET, ROS_STATIC_PEERS or CYCLONEDDS_URI allow more.

Examples:
  r4 ros2 serial:auto
  ros2 topic pub --once --keep-alive 1 /arm std_msgs/msg/Bool '{data: true}'
  ros2 topic pub --rate 10 /osmc1/command std_msgs/msg/Float32 '{data: 0.1}'
  ros2 topic pub --rate 10 /stop std_msgs/msg/Bool '{data: true}'
  r4 ros2 udp://192.168.0.125 --drive osmc1,-osmc2 --wheel-separation 0.4 --full-speed 1.5
  r4 ros2 'can://can0?node=0-3' --namespace robot       /robot/board0/R4 …

Exit codes: 0 ended by --duration or Ctrl-C; 2 usage; 4 a transport or the graph cannot be opened; 5
permission denied.)";

}  // namespace

void add_ros2(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<ros2::BridgeOptions>();
  CLI::App* const command =
      add_subcommand(root, chosen, "ros2", "Connect boards to ROS 2, without ROS", footer, options,
                     ros2::run_bridge);
  add_boards(*command, options->urls);
  add_text(*command, "--name", options->name, "name of the node (default r4)", "NAME");
  add_text(*command, "--namespace", options->space, "namespace of the node (default /)", "NAME");
  add_flag(*command, "--arm", options->arm, "arm the board once, as soon as it is connected");
  add_seconds(*command, "--deadline", options->deadline,
              "longest silence of a driving publisher (default 1, as the board); 0: no limit",
              Zero::allowed);
  add_text(*command, "--drive", options->drive, "the left and right motor channel for cmd_vel",
           "LEFT,RIGHT");
  add_text(*command, "--wheel-separation", options->separation, "metres between the two wheels",
           "METRES");
  add_text(*command, "--full-speed", options->full_speed, "metres a second of a wheel at full duty",
           "SPEED");
  add_text(*command, "--servo", options->servo,
           "us, or radians as MIN_US,MAX_US,RADIANS (default 500,2500,3.14159)", "SERVO");
  add_text(*command, "--counts-per-turn", options->counts_per_turn,
           "counts of the encoders in one turn, for joint_states", "COUNTS");
  add_text(*command, "--steps-per-turn", options->steps_per_turn,
           "steps of the steppers in one turn, for joint_states", "STEPS");
  add_fields(*command, options->fields, "state fields to request; they determine the topics");
  add_repeated(*command, "--device", options->devices,
               "add a topic for a described device on the I2C bus, such as bno055@0x28",
               "NAME@ADDRESS");
  add_duration(*command, options->duration);
  add_key(*command, options->key);
  add_json(*command, options->json, "print JSON, one object a line");
}

}  // namespace r4::tool
