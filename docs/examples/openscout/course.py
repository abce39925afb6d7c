# SPDX-License-Identifier: GPL-3.0-or-later
"""A course of waypoints, followed by pure pursuit (Coulter, CMU-RI-TR-92-01)."""
import math
from itertools import pairwise

from r4link import control

Waypoint = tuple[float, float]
LOOKAHEAD = 0.3
SLOWEST = 0.1
BRAKING = 0.5  # m/s^2


def figure_of_eight(reach: float) -> list[Waypoint]:
    """Bernoulli's lemniscate through the origin; at its ends the radius is a third of `reach`."""
    points = []
    for i in range(361):
        angle = math.radians(i - 90)
        scale = reach / (1 + math.sin(angle) ** 2)
        points.append((scale * math.cos(angle), scale * math.cos(angle) * math.sin(angle)))
    return points


class Course:
    def __init__(self, waypoints: list[Waypoint], cruise: float) -> None:
        self._cruise = cruise
        self._places: list[Waypoint] = []  # a centimetre apart
        for start, end in pairwise(waypoints):
            count = max(1, round(math.dist(start, end) * 100))
            self._places += [(start[0] + (end[0] - start[0]) * i / count, start[1] + (end[1] - start[1]) * i / count)
                             for i in range(count)]
        self._places.append(waypoints[-1])
        self._at = 0
        self.finished = False

    @property
    def heading(self) -> float:
        (x, y), (on_x, on_y) = self._places[:2]
        return math.atan2(on_y - y, on_x - x)

    @property
    def end(self) -> Waypoint:
        return self._places[-1]

    def deviation(self, x: float, y: float) -> float:
        """Distance of a place from the course, near the last call of twist()."""
        return min(math.dist((x, y), each) for each in self._places[max(0, self._at - 50):self._at + 50])

    def twist(self, pose: control.Pose) -> control.Twist:
        here = (pose.x, pose.y)
        ahead = range(self._at, min(self._at + 50, len(self._places)))
        self._at = min(ahead, key=lambda i: math.dist(here, self._places[i]))
        left = (len(self._places) - 1 - self._at) / 100
        self.finished = self.finished or left < 0.03
        if self.finished:
            return control.Twist(0)
        goal = self._places[min(self._at + round(LOOKAHEAD * 100), len(self._places) - 1)]
        dx, dy = goal[0] - pose.x, goal[1] - pose.y
        beside = math.cos(pose.yaw) * dy - math.sin(pose.yaw) * dx
        speed = min(self._cruise, max(SLOWEST, math.sqrt(2 * BRAKING * left)))
        return control.Twist(speed, speed * 2 * beside / max(dx * dx + dy * dy, 0.01))
