# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot with two motors that obeys cmd_vel. Usage: ros2 launch robot.launch.py

r4 ros2 has no --arm here, because a respawned process must not drive by itself. First look at the robot, then arm it:
ros2 topic pub --once --keep-alive 1 /robot/arm std_msgs/msg/Bool '{data: true}'
"""
from launch import LaunchDescription
from launch.actions import ExecuteProcess


def generate_launch_description():
    return LaunchDescription([
        ExecuteProcess(cmd=['r4', 'ros2', 'serial:auto', '--namespace', 'robot', '--drive', 'osmc1,osmc2',
                            '--wheel-separation', '0.42', '--full-speed', '1.5', '--counts-per-turn', '4096'],
                       output='screen', respawn=True, respawn_delay=1.0),
    ])
