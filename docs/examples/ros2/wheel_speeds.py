#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""A differential robot on cmd_vel whose wheels keep their speeds: a node beside r4 ros2.

    r4 ros2 serial:auto --counts-per-turn 4096 --deadline 0.5
    python3 wheel_speeds.py
    ros2 topic pub --once --keep-alive 1 /arm std_msgs/msg/Bool '{data: true}'

The cycle is the cycle of ros2_control: read, update, write, once for each state of the board (100 Hz). Without states
this node publishes nothing, and r4 ros2 stops the motors at its deadline.
"""
import math
import time

WHEEL_SEPARATION = 0.42  # m
WHEEL_RADIUS = 0.05  # m
FULL_SPEED = 30.0  # rad/s of a wheel at full duty
CMD_VEL_TIMEOUT = 0.5  # s
SIGNS = (1, 1)  # left, right; -1 if forward on the motor drives the robot backward (not after r4 commission)


class Wheel:
    """The duty for the wanted speed, corrected by the error of the speed (PI)."""

    P, I = 0.02, 0.1  # duty per rad/s of error; per rad/s during 1 s

    def __init__(self):
        self.integral = 0.0

    def duty(self, wanted, measured, seconds):
        if wanted == 0:
            self.integral = 0.0
            return 0.0
        missing = wanted - measured
        duty = wanted / FULL_SPEED + self.P * missing + self.integral
        if abs(duty) < 1 or duty * missing < 0:  # anti-windup: no integration at the limit
            self.integral += self.I * missing * seconds
        return max(-1.0, min(1.0, duty))


class Base:
    def __init__(self):
        self.wheels = Wheel(), Wheel()
        self.wanted = 0.0, 0.0  # rad/s
        self.supply = False  # relay 1 is closed: the motors have supply
        self.heard = self.updated = -math.inf

    def command(self, linear, angular, now):
        """`linear`: m/s forward; `angular`: rad/s to the left."""
        if not (math.isfinite(linear) and math.isfinite(angular)):
            return
        turn = angular * WHEEL_SEPARATION / 2
        speeds = (linear - turn) / WHEEL_RADIUS, (linear + turn) / WHEEL_RADIUS
        scale = min(1.0, FULL_SPEED / max(map(abs, (*speeds, FULL_SPEED))))  # the radius of the curve stays the same
        self.wanted = tuple(speed * scale for speed in speeds)
        self.heard = now

    def update(self, measured, now):
        """The duties of the two motors; `measured`: rad/s of the two encoders."""
        seconds = min(now - self.updated, 0.1)
        self.updated = now
        if not self.supply or now - self.heard > CMD_VEL_TIMEOUT or not all(map(math.isfinite, measured)):
            self.wanted = 0.0, 0.0  # without supply the wheels cannot follow: begin from rest when it returns
        return [sign * wheel.duty(wanted, sign * speed, seconds)
                for wheel, sign, wanted, speed in zip(self.wheels, SIGNS, self.wanted, measured)]


def main():
    import rclpy
    from geometry_msgs.msg import Twist
    from rclpy.node import Node
    from sensor_msgs.msg import JointState
    from std_msgs.msg import Float32, UInt32

    rclpy.init()
    node, base = Node('wheel_speeds'), Base()
    motors = [node.create_publisher(Float32, f'{motor}/command', 1) for motor in ('osmc1', 'osmc2')]

    def on_joints(joints):
        speeds = dict(zip(joints.name, joints.velocity))
        if not {'encoder1', 'encoder2'} <= speeds.keys():  # a part of the state was lost
            return
        duties = base.update((speeds['encoder1'], speeds['encoder2']), time.monotonic())
        for motor, duty in zip(motors, duties):
            motor.publish(Float32(data=duty))
    node.create_subscription(Twist, 'cmd_vel',
                             lambda twist: base.command(twist.linear.x, twist.angular.z, time.monotonic()), 1)
    node.create_subscription(UInt32, 'relays', lambda relays: setattr(base, 'supply', bool(relays.data & 1)), 1)
    node.create_subscription(JointState, 'joint_states', on_joints, 1)
    rclpy.spin(node)


if __name__ == '__main__':
    main()
