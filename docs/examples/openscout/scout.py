# SPDX-License-Identifier: GPL-3.0-or-later
"""The robot: its channels, its controllers and its position. No I/O and no clock.

    DHB1A DHB1B DHB2A DHB2B    wheel motors front left, rear left, front right, rear right; ENC1 to ENC4 in the same order
    SERVO1 to SERVO3           the arm
    US1                        looks forward
"""
from typing import NamedTuple

import r4link
from r4link import Command, Setpoints, control

TRACK = 0.30  # m
SLIP = 1.6  # measured; differs from floor to floor
WHEEL_RADIUS = 0.06
COUNTS_A_TURN = 1200
TOP_SPEED = 1.2  # m/s of a wheel at full duty
FIELDS = 'DHB1A,DHB1B,DHB2A,DHB2B,SERVO1POS,SERVO2POS,SERVO3POS,ENC1,ENC2,ENC3,ENC4,US1'
CLEARANCE_CM = 60  # a nearer obstacle makes the board safe
ENCODERS = (1, 2, 3, 4)
ARM_REST = (1500, 1500, 1500)

# The fields and limits that run_loop() supervises.
NEEDS = 'ENC1,ENC2,ENC3,ENC4'
STANDSTILL = [control.Standstill(encoder=n, channel=n, drive='dhb12', pwm=1500, time=1.0) for n in ENCODERS]


def motors(duties: tuple[float, ...]) -> Setpoints:
    return Setpoints(*(Command.dhb12(channel, duty=duty) for channel, duty in enumerate(duties, 1)))


REST = motors((0, 0, 0, 0))  # no servo commands: without pulses the arm would fall


class Wish(NamedTuple):
    twist: control.Twist
    arm: tuple[int, int, int] = ARM_REST  # microseconds


class Scout:
    def __init__(self) -> None:
        self._drive = control.FourWheelDrive(TRACK, SLIP, max_wheel=TOP_SPEED * 0.9)
        self._wheels = [control.Wheel(n, COUNTS_A_TURN, WHEEL_RADIUS) for n in ENCODERS]
        # For each wheel: 1.2 m/s at full duty, tau 0.15 s (docs/how-to/control.md, Tuning).
        self._pids = [control.Pid(0.6, 4.0, feed_forward=0.5, rate=10) for _ in ENCODERS]
        self.odometry = control.Odometry(turn_per_rad=0.02)  # the wheels slip in a turn

    def sense(self, state: r4link.State) -> None:
        rolled = control.WheelSpeeds(*(wheel.advance(state) for wheel in self._wheels))
        step = self._drive.twist(rolled)  # distances instead of speeds give a distance and an angle
        self.odometry.advance(step.forward, step.turn)

    @property
    def speed(self) -> float:
        return self._drive.twist(control.WheelSpeeds(*(wheel.speed for wheel in self._wheels))).forward

    def duties(self, twist: control.Twist, dt: float) -> tuple[float, ...]:
        """The duties of the four motors, -1 to 1. Call sense() first."""
        if twist == (0, 0) and all(abs(wheel.speed) < 0.02 for wheel in self._wheels):
            for pid in self._pids:
                pid.reset()
            return (0.0,) * 4
        return tuple(pid.step(to, wheel.speed, dt)
                     for pid, to, wheel in zip(self._pids, self._drive.wheels(twist), self._wheels))

    def command(self, wish: Wish, dt: float) -> Setpoints:
        out = motors(self.duties(wish.twist, dt))
        for channel, pulse in enumerate(wish.arm, 1):
            out.add(Command.servo(channel, us=pulse))
        return out
