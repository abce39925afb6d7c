# SPDX-License-Identifier: GPL-3.0-or-later
"""The program under test: a robot that goes forward until something is near, and then back. Usage: patrol.py URL"""
import sys

import r4link

DUTY = 0.25
NEAR_CM = 40


def patrol(url: str, turns: int = 1) -> None:
    with r4link.Board(url, fields='DEFAULT,US1') as board:
        board.wait_active()
        board.arm(timeout=3)  # nothing turns yet; from here on a program that hangs stops the robot
        board.watchdog(0.3)
        duty = DUTY
        board.osmc(1).set(duty, timeout=0.25)
        for state in board.states():
            board.feed()
            near = 0 < state.us1 < NEAR_CM
            wanted = -DUTY if near else DUTY
            if wanted != duty:
                if turns == 0:
                    return
                turns -= 1
                duty = wanted
                board.osmc(1).set(duty, timeout=0.25)


if __name__ == '__main__':
    patrol(sys.argv[1], turns=1000)
