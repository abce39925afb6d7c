# SPDX-License-Identifier: GPL-3.0-or-later
"""Control loops on the host (docs/how-to/control.md): PID, wheels, kinematics, odometry, and a loop that
ends itself.

Metres, radians, seconds; x forward, y and angles to the left, as in ROS (REP 103). The classes are
those of C++ (include/r4link/control/), and do not read a clock.
"""
from __future__ import annotations

import math
from typing import Callable, Literal, NamedTuple, Sequence

from . import _core
from ._core import Setpoints, State
from .board import Board
from .channels import _ms
from .enums import DisarmCause, LinkState, LoopEnd


class Twist(NamedTuple):
    """The movement of a robot on the ground."""
    forward: float  # m/s
    turn: float = 0.0  # rad/s


class SideSpeeds(NamedTuple):
    left: float
    right: float


class WheelSpeeds(NamedTuple):
    front_left: float
    rear_left: float
    front_right: float
    rear_right: float


class CarCommand(NamedTuple):
    speed: float  # m/s, of the middle of the rear axle
    steering: float


class Pose(NamedTuple):
    x: float
    y: float
    yaw: float


class Pid:
    """Proportional, integral and derivative control of one value. The integral stops while the
    output is limited (`minimum`, `maximum`, `rate` a second). The derivative is of the measured
    value, low-passed.

    `setpoint` and `measured` are in the same unit. `output`, `minimum` and `maximum` are in units
    of the output, such as -1 to 1 for a duty. `kp`: units of the output per unit of error; `ki`:
    per unit and second; `kd`: per unit a second; `feed_forward`: per unit of the setpoint.
    `derivative_filter`: seconds, the time constant of the low pass; 0: none. `dt`: seconds.
    """

    def __init__(self, kp: float = 0.0, ki: float = 0.0, kd: float = 0.0, *, feed_forward: float = 0.0,
                 minimum: float = -1.0, maximum: float = 1.0, rate: float = math.inf,
                 derivative_filter: float = 0.0) -> None:
        self._core = _core.Pid(kp, ki, kd, feed_forward, minimum, maximum, rate, derivative_filter)

    def step(self, setpoint: float, measured: float, dt: float) -> float:
        """The output, `dt` seconds after the last step. Raises DataError unless all values are finite."""
        return self._core.step(setpoint, measured, dt)

    def reset(self) -> None:
        """Forgets everything: the output is 0, or the limit next to 0."""
        self._core.reset()

    def take_over(self, output: float, setpoint: float, measured: float) -> None:
        """Continues without a jump from an output of another controller."""
        self._core.take_over(output, setpoint, measured)

    @property
    def output(self) -> float:
        """The newest output."""
        return self._core.output

    @property
    def integral(self) -> float:
        """The integral term of the output."""
        return self._core.integral


class Wheel:
    """A wheel with an encoder: pass each state to advance(), in order. `encoder`: 1 to 4.
    `counts_a_turn`: counts of the encoder for one turn of the wheel. `radius`: metres. `window`:
    seconds over which `speed` is the mean. `max_speed`: m/s; a faster change means a zeroed encoder
    or a restart, not a movement."""

    def __init__(self, encoder: int, counts_a_turn: float, radius: float, *, reversed: bool = False,
                 window: float = 0.05, max_speed: float = 20.0) -> None:
        self._core = _core.Wheel(encoder, counts_a_turn, radius, reversed, max(0, _ms(window)), max_speed)

    def advance(self, state: State) -> float:
        """The metres that the wheel has rolled since the last state, by ENCn."""
        return self._core.advance(state)

    def measured(self, state: State) -> float:
        """The wheel's speed in m/s as the board measures it (ENCnHZ): new ten times a second."""
        return self._core.measured(state)

    def reset(self) -> None:
        """Forgets earlier states."""
        self._core.reset()

    @property
    def speed(self) -> float:
        """The wheel's speed in m/s by the counts of the last `window`: new with each state."""
        return self._core.speed


class SteeringSensor:
    """The steering angle by AINSTEER, linear between two ends, each (volts, radians). `margin`: volts
    beyond an end that count as an angle. `angle`: radians."""

    def __init__(self, left: tuple[float, float], right: tuple[float, float], margin: float = 0.3) -> None:
        self._core = _core.SteeringSensor(left, right, margin)

    def angle(self, state: State) -> float | None:
        """In radians. None if the voltage is impossible, because a cable is off: then do not drive."""
        return self._core.angle(state)

    def volts(self, angle: float) -> float:
        """The voltage of an angle."""
        return self._core.volts(angle)


class DifferentialDrive:
    """Two driven wheels, `separation` metres apart. If a wheel would be faster than `max_wheel`
    m/s, the robot slows down on the same curve."""

    def __init__(self, separation: float, max_wheel: float = math.inf) -> None:
        self._core = _core.DifferentialDrive(separation, max_wheel)

    def wheels(self, twist: Twist) -> SideSpeeds:
        """The speed of each wheel for a movement of the robot."""
        return SideSpeeds(*self._core.wheels(*twist))

    def twist(self, wheels: SideSpeeds) -> Twist:
        """The movement of the robot with these wheel speeds."""
        return Twist(*self._core.twist(*wheels))


class FourWheelDrive:
    """Four driven wheels that slip to turn, as if `track`, in metres from left to right, were wider
    by the ratio `slip`. If a wheel would be faster than `max_wheel` m/s, the robot slows down on
    the same curve."""

    def __init__(self, track: float, slip: float = 1.5, max_wheel: float = math.inf) -> None:
        self._core = _core.FourWheelDrive(track, slip, max_wheel)

    def wheels(self, twist: Twist) -> WheelSpeeds:
        """The speed of each wheel for a movement of the robot."""
        return WheelSpeeds(*self._core.wheels(*twist))

    def twist(self, wheels: WheelSpeeds) -> Twist:
        """The movement of the robot with these wheel speeds."""
        return Twist(*self._core.twist(*wheels))


class Ackermann:
    """A car with front steering; its position is the middle of its rear axle. `wheelbase` and
    `track` are in metres, `max_steering` and `steering` in radians, `max_speed` in m/s."""

    def __init__(self, wheelbase: float, max_steering: float, *, track: float = 0.0, max_speed: float = math.inf) -> None:
        self._core = _core.Ackermann(wheelbase, track, max_steering, max_speed)

    def command(self, twist: Twist) -> CarCommand:
        """For a turn on the spot, which is impossible, the speed is 0."""
        return CarCommand(*self._core.command(*twist))

    def twist(self, command: CarCommand) -> Twist:
        """The movement of the robot with that speed and steering."""
        return Twist(*self._core.twist(*command))

    def limited_steering(self, steering: float) -> float:
        """The angle within the limits of the steering."""
        return self._core.limited_steering(steering)

    def front_wheels(self, steering: float) -> SideSpeeds:
        """The angle of each front wheel, in radians."""
        return SideSpeeds(*self._core.front_wheels(steering))

    def rear_wheels(self, command: CarCommand) -> SideSpeeds:
        """The speed of each rear wheel, in m/s."""
        return SideSpeeds(*self._core.rear_wheels(*command))


class Odometry:
    """The pose of a robot by the movements of its wheels, and its covariance. The variances of each
    step: `length_per_m`, m^2 a metre of the way; `turn_per_m`, rad^2 a metre of the way;
    `turn_per_rad`, rad^2 a radian."""

    def __init__(self, *, length_per_m: float = 0.0004, turn_per_m: float = 0.0004, turn_per_rad: float = 0.0025) -> None:
        self._core = _core.Odometry(length_per_m, turn_per_m, turn_per_rad)

    def advance(self, length: float, turn: float) -> None:
        """The robot has moved by `length` metres (below 0: backwards) and turned by `turn` radians."""
        self._core.advance(length, turn)

    def reset(self, pose: Pose = Pose(0.0, 0.0, 0.0), covariance: Sequence[float] = (0.0,) * 9) -> None:
        """Sets the known pose."""
        self._core.reset(*pose, covariance)

    @property
    def pose(self) -> Pose:
        """The position and heading of the robot."""
        return Pose(*self._core.pose)

    @property
    def covariance(self) -> tuple[float, ...]:
        """The covariance of x, y and yaw, row by row."""
        return self._core.covariance

    def ros_covariance(self, unknown: float = 1e6) -> tuple[float, ...]:
        """The 36 numbers of geometry_msgs/PoseWithCovariance. `unknown`: the variance of z (m^2)
        and of the rotations about x and y (rad^2), which odometry on the ground cannot measure."""
        return self._core.ros_covariance(unknown)


class Standstill(NamedTuple):
    """A motor with an encoder. At `pwm` or more, the motor turns by more than `counts` in `time` seconds."""
    encoder: int = 1
    channel: int = 1
    drive: Literal['osmc', 'dhb12', 'bldc'] = 'osmc'
    pwm: int = 400
    counts: int = 3
    time: float = 0.5


class LoopReport(NamedTuple):
    end: LoopEnd
    why: str
    at_rest: bool  # the outputs are as in `rest`, or safe; if not, `why` has the fix
    steps: int


def _options(fields: str, late: float, first: float, standstill: Sequence[Standstill], rest: Setpoints,
             rest_timeout: float, watchdog: float, arming: bool = True) -> _core.LoopOptions:
    options = _core.LoopOptions(fields, _ms(late), _ms(first), rest, _ms(rest_timeout), _ms(watchdog), arming)
    for each in standstill:
        options.add_standstill(each.encoder, each.drive, each.channel, each.pwm, each.counts, _ms(each.time))
    return options


class LoopGuard:
    """Ends a loop of your own, such as a loop with asyncio. `late`, `first`: seconds, as in
    run_loop(). `now`: seconds of time.monotonic()."""

    def __init__(self, *, fields: str = '', late: float = 0.1, first: float = 1.0,
                 standstill: Sequence[Standstill] = ()) -> None:
        self._core = _core.LoopGuard(_options(fields, late, first, standstill, Setpoints(), 0.2, 0.3))

    def start(self, now: float) -> None:
        """Call start() when the loop begins."""
        self._core.start(now)

    def on_state(self, state: State, disarmed_by: DisarmCause | str, now: float) -> float | None:
        """If a step is due: the seconds since the last step, on the board's clock. Otherwise None."""
        return self._core.on_state(state, disarmed_by, now)

    def on_commanded(self, setpoints: Setpoints) -> None:
        """Call on_commanded() with the commands of the step. A motor without a command keeps its earlier command."""
        self._core.on_commanded(setpoints)

    def check(self, link: LinkState | str, disarmed_by: DisarmCause | str, now: float) -> LoopEnd:
        """Call check() at `deadline` at the latest, with Board.link.state and Board.disarmed_by."""
        return self._core.check(link, disarmed_by, now)

    @property
    def deadline(self) -> float:
        """If no state arrives before, the loop is late at this time. Seconds of time.monotonic()."""
        return self._core.deadline

    @property
    def ended(self) -> LoopEnd:
        """Why the loop has ended; LoopEnd.NONE if it has not."""
        return self._core.ended

    @property
    def why(self) -> str:
        """Why the loop has ended, in words."""
        return self._core.why


def run_loop(board: Board, step: Callable[[State, float], Setpoints | None], *, rest: Setpoints, fields: str = '',
             late: float = 0.1, first: float = 1.0, standstill: Sequence[Standstill] = (), rest_timeout: float = 0.2,
             watchdog: float = 0.3, arming: bool = True) -> LoopReport:
    """Runs a loop on this thread until it ends. Calls `step(state, dt)` for each new state that has
    all `fields`. `dt`: seconds since the last step on the board's clock. The result of the step is
    posted; None ends the loop. Then the outputs are set to `rest`, and after that exceptions of the
    step and Ctrl-C are raised. `arming`: as in Board.

    `late`: seconds after which the newest state is too old. `first`: seconds that the first state
    may take. `rest_timeout`: seconds in which the board must confirm `rest`; otherwise the board
    is stopped. `watchdog`: seconds that a step may take, as in Board.watchdog(); 0: the program feeds
    the watchdog itself, or has none.
    """
    options = _options(fields, late, first, standstill, rest, rest_timeout, watchdog, arming)
    return LoopReport(*board._core.run_loop(options, step))


def wrapped(angle: float) -> float:
    """The `angle`, in radians, within -pi and pi."""
    return _core.wrapped(angle)


__all__ = ['Ackermann', 'CarCommand', 'DifferentialDrive', 'FourWheelDrive', 'LoopEnd', 'LoopGuard', 'LoopReport',
           'Odometry', 'Pid', 'Pose', 'SideSpeeds', 'Standstill', 'State', 'SteeringSensor', 'Twist', 'Wheel', 'WheelSpeeds',
           'run_loop', 'wrapped']
