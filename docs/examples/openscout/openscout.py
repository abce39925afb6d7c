#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Drives an OpenScout: by keyboard, by gamepad, or along a course.

    openscout.py URL                                    w s a d drive, u j i k o l move the arm, space stops, q ends
    openscout.py URL --gamepad /dev/input/event5
    openscout.py URL --course 2,0 2,1                   metres from the start: x forward, y to the left
    openscout.py URL --eight 1.5

If URL is `model`, the program uses a simulated board in this process with a model of the robot. Exit code: 0 the course
or the person's input ended, 3 the robot stopped before the end, other codes as in r4.
"""
import argparse
import contextlib
import sys

import r4link
from course import Course, Waypoint, figure_of_eight
from hand import Gamepad, Keyboard
from model import Behind
from r4link import control
from scout import CLEARANCE_CM, FIELDS, NEEDS, REST, STANDSTILL, Scout, Wish

CRUISE = 0.8


def waypoint(text: str) -> Waypoint:
    x, y = text.split(',')
    return float(x), float(y)


def drive(board: r4link.Board, hand: Keyboard | Gamepad | None, course: Course | None,
          start: control.Pose | None = None) -> control.LoopReport:
    scout = Scout()
    if start:
        scout.odometry.reset(start)

    def step(state: r4link.State, dt: float) -> r4link.Setpoints | None:
        scout.sense(state)
        wish = Wish(control.Twist(0))
        if course:
            wish = Wish(course.twist(scout.odometry.pose))
            if course.finished and abs(scout.speed) < 0.02:
                return None
        elif hand:
            wish = hand.wish()
            if hand.stop:
                board.stop(timeout=0.2)
            if hand.stop or hand.ended:
                return None
        return scout.command(wish, dt)

    return control.run_loop(board, step, rest=REST, fields=NEEDS, late=0.15, standstill=STANDSTILL)


def run(options: argparse.Namespace, course: Course | None, ends: contextlib.ExitStack) -> int:
    url = options.url
    if url == 'model':
        sim = r4link.SimBoard()
        ends.enter_context(Behind(sim))
        url = sim.url
    board = ends.enter_context(r4link.Board(url, fields=FIELDS))
    hand: Keyboard | Gamepad | None = None
    if not course:
        hand = Gamepad(options.gamepad) if options.gamepad else Keyboard()
        ends.callback(hand.close)
    board.wait_active()
    board.arm()
    # After arm(): a board that restarts forgets the threshold, but is then also disarmed.
    board.proximity(1, cm=CLEARANCE_CM)
    if hand:
        hand.begin()
    print('armed: it drives', flush=True)
    # The start of the figure of eight is straight ahead of the robot.
    start = control.Pose(0, 0, course.heading) if course and not options.course else None
    report = drive(board, hand, course, start)
    print(report.why, flush=True)
    return 0 if report.end is control.LoopEnd.ASKED else 3


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('url')
    parser.add_argument('--gamepad', metavar='DEVICE')
    parser.add_argument('--course', nargs='+', type=waypoint, metavar='X,Y')
    parser.add_argument('--eight', type=float, metavar='METRES')
    options = parser.parse_args()
    course = None
    if options.course or options.eight:
        course = Course([(0, 0), *options.course] if options.course else figure_of_eight(options.eight), CRUISE)
    code = 0
    try:
        with contextlib.ExitStack() as ends:
            code = run(options, course, ends)
    except r4link.Error as error:
        print(f'openscout: {error}', file=sys.stderr)
        return 3
    except OSError as error:
        print(f'openscout: {error}', file=sys.stderr)
        return 4
    return code


if __name__ == '__main__':
    sys.exit(main())
