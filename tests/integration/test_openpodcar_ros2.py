# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/examples/openpodcar with ROS 2: openpodcar_ros2 with the model of its vehicle, and a Fast DDS peer. The peer
publishes the messages of joy_node and other nodes, and reads /odom.

On a busy machine the joystick may be silent for longer than its timeout. The vehicle then stops, as it must, so the
tests press start again until the vehicle drives."""
import math
import os
import queue
import signal
import struct
import subprocess
import threading
import time

import pytest

from r4_process import PATIENCE_S, R4
from ros2_peer import TWIST, Cdr, Peer, own_domain, text, twist

PROGRAM = os.path.join(os.path.dirname(R4), 'tests', 'openpodcar_ros2')
JOY, GOAL, ODOMETRY = ('sensor_msgs::msg::dds_::Joy_', 'geometry_msgs::msg::dds_::PoseStamped_',
                       'nav_msgs::msg::dds_::Odometry_')
PERIOD_S = 0.05
HOLD, START, STOP, SPEED_AXIS = 4, 7, 1, 1  # JoyMap in pilot.hpp


def header(frame):
    data = struct.pack('<iI', 0, 0) + text(frame)
    return data + bytes(-len(data) % 4)


def joy(hold=False, start=False, stop=False, speed=0.0):
    axes, buttons = [0.0] * 6, [0] * 8
    axes[SPEED_AXIS] = speed
    buttons[HOLD], buttons[START], buttons[STOP] = hold, start, stop
    return header('') + struct.pack('<I6fI8i', 6, *axes, 8, *buttons)


def goal(x, y, frame='odom'):
    data = header(frame)
    return data + bytes(-len(data) % 8) + struct.pack('<7d', x, y, 0, 0, 0, 0, 1)


class Odometry:
    def __init__(self, payload):
        cdr = Cdr(payload)
        self.stamp, self.frame = cdr.header()
        self.child = cdr.text()
        self.x, self.y, _, *self.orientation = (cdr.take('d') for _ in range(7))
        self.covariance = [cdr.take('d') for _ in range(36)]
        self.speed = cdr.take('d')


class Scene:
    """The program, a peer that publishes to it, and the lines that the program has printed."""

    def __init__(self, domain, peer):
        self.peer, self.said, self.lines = peer, [], queue.Queue()
        self.process = subprocess.Popen([PROGRAM], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                        env=domain)
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()
        for topic, of in (('joy', JOY), ('cmd_vel', TWIST), ('goal_pose', GOAL)):
            peer.writer(f'rt/{topic}', of)
        peer.read('rt/odom', ODOMETRY)
        self.odometry = Odometry(peer.sample('rt/odom'))

    def _read(self):
        for line in self.process.stdout:
            self.lines.put(line)

    def publish_until(self, is_it, press=False, joystick=True, cmd_vel=None, goal_pose=None, timeout=PATIENCE_S,
                      **buttons):
        """Repeats the messages until `is_it` is true, and collects the new lines of the program in `said`.
        `press`: every second message presses start."""
        self.said.clear()
        deadline, start = time.monotonic() + timeout, False
        while time.monotonic() < deadline:
            start = press and not start
            if joystick:
                self.peer.write('rt/joy', joy(start=start, **buttons))
            if cmd_vel:
                self.peer.write('rt/cmd_vel', twist(*cmd_vel))
            if goal_pose:
                self.peer.write('rt/goal_pose', goal_pose)
            until = time.monotonic() + PERIOD_S
            while (left := until - time.monotonic()) > 0:
                try:
                    self.odometry = Odometry(self.peer.sample('rt/odom', timeout=left))
                except AssertionError:
                    break
                while not self.lines.empty():
                    self.said.append(self.lines.get())
                if is_it():
                    return True
        return False

    def drives(self, **published):
        assert self.publish_until(lambda: abs(self.odometry.speed) > 0.2, press=True, **published), self.said

    def stands(self, **published):
        """Asserts that the vehicle stops, and stays in its place for a second."""
        assert self.publish_until(lambda: self.odometry.speed == 0, **published), self.said
        place = self.odometry.x, self.odometry.y
        self.publish_until(lambda: False, timeout=1, **published)
        assert math.dist(place, (self.odometry.x, self.odometry.y)) < 0.01

    def stops(self, why, before, **published):
        """Asserts that `published` stops the vehicle that `before` drives. If the reason is different, repeats this."""
        deadline = time.monotonic() + 3 * PATIENCE_S
        while True:
            self.drives(**before)
            assert self.publish_until(lambda: any(line.startswith('stopped') for line in self.said), **published)
            if why in self.said[-1]:
                return
            assert time.monotonic() < deadline, self.said


@pytest.fixture(scope='module', name='scene')
def make_scene():
    domain = own_domain()
    with Peer(domain) as peer:
        made = Scene(domain, peer)
        try:
            yield made
            made.process.send_signal(signal.SIGINT)
            assert made.process.wait(timeout=PATIENCE_S) == 0
        finally:
            made.process.kill()
            made.process.wait()
            made.reader.join()
            made.process.stdout.close()
        peer.end()


def test_topics_use_the_types_and_frames_of_ros(scene):
    for kind, topic, of, hashed in (('reader', 'joy', JOY, '0d356c79'), ('reader', 'cmd_vel', TWIST, '9c45bf16'),
                                    ('reader', 'goal_pose', GOAL, '10f3786d'), ('writer', 'odom', ODOMETRY, '3cc97dc7')):
        endpoint = scene.peer.endpoint(kind, f'rt/{topic}')
        assert endpoint['of'] == of and endpoint['user_data'].startswith(f'typehash=RIHS01_{hashed}')
    odometry = Odometry(scene.peer.sample('rt/odom'))
    assert (odometry.frame, odometry.child) == ('odom', 'base_link')
    assert abs(odometry.stamp - time.time()) < PATIENCE_S
    assert math.hypot(*odometry.orientation) == pytest.approx(1)
    assert odometry.covariance[14] == 1e6  # z is unknown


def test_nothing_drives_before_start_is_pressed(scene):
    scene.stands(hold=True, speed=0.5, cmd_vel=(0.5, 0))


def test_a_silent_joystick_stops_the_podcar_until_start_is_pressed(scene):
    driving = {'hold': True, 'speed': 0.5}
    before = scene.odometry.x
    scene.stops('the joystick is silent', driving, joystick=False)
    scene.stands(joystick=False)
    assert scene.odometry.x > before + 0.05 and scene.odometry.covariance[0] > 0
    scene.stands(**driving)
    scene.drives(**driving)


def test_the_podcar_drives_while_cmd_vel_is_published(scene):
    scene.drives(cmd_vel=(0.5, 0.1))
    scene.stands()


def test_the_stop_button_stops_the_podcar(scene):
    driving = {'cmd_vel': (0.5, 0)}
    scene.stops('the stop button', driving, stop=True)
    scene.stands(**driving)


def test_the_podcar_drives_to_a_goal_only_in_the_frame_odom(scene):
    scene.publish_until(lambda: False, timeout=0.6)  # until cmd_vel has timed out
    other = goal(3, 0, 'map')
    assert scene.publish_until(lambda: any('not in the frame odom' in line for line in scene.said), goal_pose=other)
    there = goal(scene.odometry.x + 3, scene.odometry.y)
    scene.drives(goal_pose=there)


@pytest.mark.parametrize('arguments, environment, named', [
    (('fax:1',), {}, 'fax'), ((), {'ROS_DOMAIN_ID': '999'}, 'ROS_DOMAIN_ID'), (('sim:', 'more'), {}, 'more')])
def test_an_invalid_configuration_is_refused(arguments, environment, named):
    result = subprocess.run([PROGRAM, *arguments], env={**own_domain(), **environment}, capture_output=True, text=True,
                            timeout=PATIENCE_S, check=False)
    assert result.returncode == 2 and named in result.stderr, result
