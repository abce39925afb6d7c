#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/examples/teleop drives a simulated robot, and is safe. Usage: teleop.py TELEOP; env R4 = the r4 command.

The test sends keys through a terminal. The pins of the simulated chips and the encoders show the robot's movement."""
import os
import pathlib
import pty
import queue
import re
import signal
import subprocess
import sys
import threading
import time

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / 'integration'))
from r4_process import PATIENCE_S, Board  # noqa: E402

SPEED = 614  # 0.15 of 4095


class Teleop:
    """The program in a terminal, with simulated key presses."""

    def __init__(self, program, url):
        self.keyboard, terminal = pty.openpty()
        self.process = subprocess.Popen([program, url], stdin=terminal, stdout=subprocess.PIPE, text=True,
                                        start_new_session=True)
        os.close(terminal)
        self.lines = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        for line in self.process.stdout:
            self.lines.put(line)
        self.lines.put('')

    def press(self, keys):
        os.write(self.keyboard, keys.encode())

    def says(self, pattern):
        seen = []
        deadline = time.monotonic() + PATIENCE_S
        while True:
            try:
                seen.append(self.lines.get(timeout=max(0, deadline - time.monotonic())))
            except queue.Empty:
                raise AssertionError(f'it does not say {pattern!r}: {seen}') from None
            assert seen[-1], f'the program ended without {pattern!r}: {seen}'
            if re.search(pattern, seen[-1]):
                return seen[-1]


def driven(left, right):
    def is_so(each):
        return 'outputs' in each and [pwm * (1 if forward else -1) for pwm, forward in each['outputs']['osmc'][:2]] == \
            [left, right]
    return is_so


def stands(each):
    return 'outputs' in each and not any(pwm for pwm, _ in each['outputs']['osmc'])


def arm_and_drive(teleop, board):
    teleop.press('e')
    while not teleop.says('^armed|handle was released').startswith('armed'):
        teleop.press('e')  # repeated until teleop has received that the handle is held
    board.next(lambda each: each.get('supply') and stands(each))
    teleop.press('w')
    each = board.next(lambda each: 'outputs' in each and not stands(each))
    assert each['supply'] and each['outputs']['relays'] & 1, each


def main(program):
    def world(words):
        board.process.stdin.write(words + '\n')
        board.process.stdin.flush()

    with Board('udp://127.0.0.1:0', options=['--stdin', '--sensors', '0.05'], stdin=subprocess.PIPE) as board:
        teleop = Teleop(program, board.host_url)
        teleop.says(r'^not armed \(not yet\)')
        teleop.press('w')  # ignored before the board is armed
        arm_and_drive(teleop, board)
        moved = board.next(lambda each: each['type'] == 'sensors' and each['enc'][0] > 50)
        assert moved['supply'] and moved['enc'][1] > 0
        board.next(driven(0, 0))  # the key is released
        teleop.press('a')
        board.next(driven(-SPEED, SPEED))

        world('handle released')
        teleop.says(r'^not armed \(handle\)')
        teleop.press('e')
        teleop.says('handle')
        world('handle held')
        board.next(lambda each: each.get('happened') == 'handle held')
        board.next(lambda each: each.get('reason') == 'none')
        teleop.press('w')  # without effect until the board is armed again
        arm_and_drive(teleop, board)

        teleop.press('w ')  # the stop has priority over the key w
        teleop.says('^stopped')
        board.next(lambda each: each.get('reason') == 'stop')
        arm_and_drive(teleop, board)

        teleop.process.send_signal(signal.SIGSTOP)  # the program hangs
        board.next(lambda each: each.get('reason') == 'link')
        teleop.process.send_signal(signal.SIGCONT)
        teleop.says(r'^not armed')
        arm_and_drive(teleop, board)

        os.close(teleop.keyboard)
        board.next(lambda each: each.get('reason') == 'stop')
        assert teleop.process.wait(PATIENCE_S) == 0
        teleop = Teleop(program, board.host_url)  # starts while the stop is latched
        teleop.says(r'^not armed')
        teleop.press('e')
        teleop.says(r'not armed: an emergency stop came before this program began')
        teleop.press('c')
        board.next(lambda each: each.get('reason') == 'none')
        arm_and_drive(teleop, board)
        teleop.press('q')
        assert teleop.process.wait(PATIENCE_S) == 0
        unsafe = [each for each in board.rest() if 'outputs' in each and not stands(each) and not each['supply']]
        assert not unsafe, unsafe
    print('install: teleop drives when it is armed, and not otherwise')


main(sys.argv[1])
