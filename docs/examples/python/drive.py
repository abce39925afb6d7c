#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Drives a motor and shows what it does. Usage: drive.py URL"""
import sys

import r4link


def main(url: str) -> None:
    with r4link.Board(url) as board:
        board.wait_active()
        who = board.identify()
        print(f'board {who.board_id}, firmware {who.firmware}, at {board.name}')
        board.fields('DEFAULT,ENC1')
        board.arm()
        board.osmc(1).set(0.1)
        for count, state in enumerate(board.states()):
            if count % 10 == 0:
                direction = 'forward' if state.osmc1.direction else 'reverse'
                print(f'OSMC 1: {state.osmc1.pwm} {direction}, encoder {state.enc1}, {state.ain24:.2f} V')
            if count == 30:
                break
        board.osmc(1).set(0)


if __name__ == '__main__':
    main(sys.argv[1])
