# SPDX-License-Identifier: GPL-3.0-or-later
"""A model of the robot: wheel motors, encoders, and a body that slips to turn. A thread connects it to a simulated
board: every 10 ms the outputs go to the motors, and the counts of the wheels to the encoder inputs."""
import math
import threading
import time
from types import TracebackType

import r4link
import scout

TIME_CONSTANT = 0.15  # s, of a wheel with its motor and its share of the mass
FRICTION = 3.0  # m/s^2, of the gears, without a supply
STEP = 0.001
LONGEST = 0.02  # s, longest step: if a busy machine delays the thread, the robot stands still during the delay
METRES_A_COUNT = 2 * math.pi * scout.WHEEL_RADIUS / scout.COUNTS_A_TURN


class ScoutModel:
    def __init__(self, yaw: float = 0) -> None:
        self.x = self.y = 0.0
        self.yaw = yaw
        self.travelled = 0.0
        self.speeds = [0.0] * 4
        self._rolled = [0.0] * 4

    def advance(self, duties: tuple[float, ...], supply: bool, dt: float) -> None:
        for _ in range(round(dt / STEP)):
            for i, duty in enumerate(duties):
                if supply:
                    self.speeds[i] += (duty * scout.TOP_SPEED - self.speeds[i]) * STEP / TIME_CONSTANT
                else:
                    self.speeds[i] -= math.copysign(min(abs(self.speeds[i]), FRICTION * STEP), self.speeds[i])
                self._rolled[i] += self.speeds[i] * STEP
            left, right = sum(self.speeds[:2]) / 2, sum(self.speeds[2:]) / 2
            forward = (left + right) / 2
            self.x += forward * STEP * math.cos(self.yaw)
            self.y += forward * STEP * math.sin(self.yaw)
            self.yaw += (right - left) / (scout.TRACK * scout.SLIP) * STEP
            self.travelled += abs(forward) * STEP

    @property
    def counts(self) -> tuple[int, ...]:
        return tuple(math.floor(each / METRES_A_COUNT) for each in self._rolled)

    @property
    def speed(self) -> float:
        return sum(self.speeds) / 4

    @staticmethod
    def braking_distance(speed: float) -> float:
        return speed * speed / (2 * FRICTION)


class Behind:
    """`with Behind(sim) as model:` connects the model to the simulated board."""

    def __init__(self, sim: r4link.SimBoard, yaw: float = 0) -> None:
        self._sim = sim
        self._model = ScoutModel(yaw)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def _run(self) -> None:
        then = time.monotonic()
        while not self._ended.wait(0.01):
            look = self._sim.look()
            now = time.monotonic()
            then = max(then, now - LONGEST)
            whole = round((now - then) / STEP)
            then += whole * STEP
            self._model.advance(tuple(each.duty for each in look.dhb12), look.supply, whole * STEP)
            for channel, counts in enumerate(self._model.counts, 1):
                self._sim.turn(channel, counts)

    def __enter__(self) -> ScoutModel:
        self._thread.start()
        return self._model

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self._ended.set()
        self._thread.join()
