# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot on two motors that drives by cmd_vel: ros2 launch robot.launch.py

No --arm: what is respawned would drive again by itself. When you have looked:
ros2 topic pub --once /robot/arm std_msgs/msg/Bool '{data: true}'
"""
from launch import LaunchDescription
from launch.actions import ExecuteProcess


def generate_launch_description():
    return LaunchDescription([
        ExecuteProcess(cmd=['r4', 'ros2', 'serial:auto', '--namespace', 'robot', '--deadline', '0.5',
                            '--drive', 'osmc1,-osmc2', '--wheel-separation', '0.42', '--full-speed', '1.5'],
                       output='screen', respawn=True, respawn_delay=1.0),
    ])
