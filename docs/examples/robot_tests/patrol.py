# SPDX-License-Identifier: GPL-3.0-or-later
"""The program under test: a robot that drives forward until an obstacle is near, then backward. Usage: patrol.py URL"""
import sys

import r4link

DUTY = 0.25
NEAR_CM = 40


def patrol(url: str, turns: int = 1) -> None:
    with r4link.Board(url, fields='DEFAULT,US1') as board:
        board.wait_active()
        board.arm(timeout=3)  # no motor turns yet
        board.watchdog(0.3)  # a hang of this program stops the robot
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
