# SPDX-License-Identifier: GPL-3.0-or-later
"""How well it keeps to a course, in no time, on the model alone; what its hand says; and how far it rolls when something
happens, as a process against a simulated board with the model behind it."""
import math
import os
import pathlib
import struct
import subprocess
import sys
import time

import pytest

import r4link
import scout
from course import Course, figure_of_eight
from hand import Gamepad
from model import Behind, ScoutModel
from openscout import CRUISE
from r4link import control
from r4link.testing import make_state

PATIENCE_S = 20
TIMEOUT_S = 1.0  # of the board
PROGRAM = pathlib.Path(__file__).with_name('openscout.py')


class Pins:
    """What the program commanded two states ago, for the link takes its time."""

    def __init__(self):
        self._under_way = [(0.0,) * 4] * 2

    def after(self, duties):
        self._under_way.append(duties)
        return self._under_way.pop(0)


def follow(course, start):
    """Drives the course on the model, 100 states a second; how far beside it at most, and the model at its end."""
    robot, model, pins, worst = scout.Scout(), ScoutModel(), Pins(), 0.0
    model.yaw = start.yaw
    robot.odometry.reset(start)
    for t_ms in range(0, 60_000, 10):
        fields = {f'enc{i}': count for i, count in enumerate(model.counts, 1)}
        robot.sense(make_state(t_ms, **fields))
        duties = robot.duties(course.twist(robot.odometry.pose), 0.01)
        model.advance(pins.after(duties), True, 0.01)
        worst = max(worst, course.deviation(model.x, model.y))
        if course.finished and abs(robot.speed) < 0.02:
            return worst, model
    raise AssertionError('it does not arrive')


def test_it_drives_a_figure_of_eight():
    course = Course(figure_of_eight(1.5), CRUISE)
    worst, model = follow(course, control.Pose(0, 0, course.heading))
    print(f'{worst:.3f} m beside it at most, {math.hypot(model.x, model.y):.3f} m from its end')
    assert worst <= 0.10
    assert math.hypot(model.x, model.y) <= 0.10


def test_it_passes_its_waypoints():
    waypoints = [(0, 0), (1.5, 0), (2.2, 0.7), (2.2, 2)]
    worst, model = follow(Course(waypoints, CRUISE), control.Pose(0, 0, 0))
    print(f'{worst:.3f} m beside them at most')
    assert worst <= 0.20
    assert math.dist((model.x, model.y), waypoints[-1]) <= 0.10


@pytest.fixture(name='plugged')
def make_plugged(tmp_path):
    """A gamepad, what makes it say something, and what unplugs it."""
    events = tmp_path / 'event0'
    os.mkfifo(events)
    pad = Gamepad(str(events))
    writer = os.open(events, os.O_WRONLY)
    yield (pad, lambda *event: os.write(writer, struct.pack('llHHi', 0, 0, *event)), lambda: os.close(writer))
    pad.close()


def test_the_gamepad_drives_while_its_shoulder_is_held(plugged):
    pad, happens, unplug = plugged
    happens(3, Gamepad.ABS_Y, -32768)
    assert pad.wish().twist == (0, 0)
    happens(1, Gamepad.SHOULDER, 1)
    assert pad.wish().twist.forward == pytest.approx(0.5)
    happens(3, Gamepad.ABS_RY, 32767)
    pad.wish()
    time.sleep(0.02)
    assert pad.wish().arm[1] > 1500
    happens(1, Gamepad.SHOULDER, 0)
    assert pad.wish().twist == (0, 0)
    happens(1, Gamepad.LOWER, 1)
    assert pad.wish() and pad.stop and not pad.ended
    happens(1, Gamepad.SHOULDER, 1)
    unplug()
    assert pad.wish().twist == (0, 0) and pad.ended


def test_the_gamepad_stands_where_the_kernel_dropped_what_it_said(plugged):
    pad, happens, unplug = plugged
    happens(3, Gamepad.ABS_Y, -32768)
    happens(1, Gamepad.SHOULDER, 1)
    happens(0, 0, 0)
    assert pad.wish().twist.forward > 0
    happens(0, 3, 0)  # SYN_DROPPED: that the button was let go is lost
    assert pad.wish().twist == (0, 0)
    happens(1, Gamepad.SHOULDER, 1)  # is not whole
    happens(3, Gamepad.ABS_Y, -32768)
    assert pad.wish().twist == (0, 0)
    happens(0, 0, 0)
    happens(3, Gamepad.ABS_Y, -32768)
    happens(1, Gamepad.SHOULDER, 2)
    happens(0, 0, 0)
    assert pad.wish().twist == (0, 0)
    happens(1, Gamepad.SHOULDER, 0)
    happens(1, Gamepad.SHOULDER, 1)
    assert pad.wish().twist.forward > 0
    unplug()


def until(done):
    deadline = time.monotonic() + PATIENCE_S
    while not done():
        assert time.monotonic() < deadline, 'it did not come'
        time.sleep(0.005)


def let_go(sim, _):
    sim.handle(False)


def obstacle(sim, _):
    sim.obstacle(1, 30)


def killed(_, program):
    program.kill()


@pytest.mark.parametrize('happens, notice_s', [(let_go, 0.0), (obstacle, 0.5), (killed, TIMEOUT_S)],
                         ids=['handle let go', 'obstacle', 'killed'])
def test_it_stands_within_its_braking_distance_and_one_timeout(happens, notice_s):
    with r4link.SimBoard('udp://127.0.0.1:0') as sim, Behind(sim) as model:
        with subprocess.Popen([sys.executable, PROGRAM, sim.url, '--course', '50,0'], stdout=subprocess.PIPE,
                              text=True) as program:
            until(lambda: model.speed > 0.9 * CRUISE)
            speed, begun = model.speed, model.travelled
            happens(sim, program)
            until(lambda: model.speed < 0.001 and sim.look().is_safe)
            rolled = model.travelled - begun
            if happens is not killed:
                assert program.wait(PATIENCE_S) == 3
                told = program.stdout.read()
                assert ('handle' if happens is let_go else 'proximity') in told, told
    # This machine may be busy: a quarter of a second until the model hears of the pins.
    allowed = ScoutModel.braking_distance(1.1 * speed) + 1.1 * speed * (notice_s + 0.25)
    print(f'{rolled:.3f} m, of {allowed:.3f} m')
    assert rolled <= allowed
