# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/examples/openpodcar: the program at a terminal, with the vehicle model of r4 sim."""
import os
import pty
import queue
import signal
import subprocess
import threading
import time

import pytest

from r4_process import PATIENCE_S, R4, Board

PROGRAM = os.path.join(os.path.dirname(R4), 'tests', 'openpodcar')


class Podcar:
    """The running program. `typed`: the input in the terminal before the program begins."""

    def __init__(self, url, typed=b''):
        self.keyboard, terminal = pty.openpty()
        os.write(self.keyboard, typed)
        self.process = subprocess.Popen([PROGRAM, url, '50,0'], stdin=terminal, stdout=subprocess.PIPE,
                                        stderr=subprocess.STDOUT, text=True)
        os.close(terminal)
        self.lines = queue.Queue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        for line in self.process.stdout:
            self.lines.put(line)

    def says(self, words, timeout=PATIENCE_S):
        deadline = time.monotonic() + timeout
        while True:
            try:
                line = self.lines.get(timeout=max(0, deadline - time.monotonic()))
            except queue.Empty:
                raise AssertionError(f'it does not say {words!r}') from None
            if words in line:
                return line

    def enter(self):
        os.write(self.keyboard, b'\n')

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()
        self._reader.join()
        self.process.stdout.close()
        os.close(self.keyboard)


@pytest.fixture(name='board')
def make_board():
    with Board('udp://127.0.0.1:0', options=('--stdin', '--sensors', '0.05'), stdin=subprocess.PIPE) as board:
        yield board
        board.process.stdin.close()


def happen(board, words):
    board.process.stdin.write(words + '\n')
    board.process.stdin.flush()


def is_driven(each):
    return each.get('outputs', {}).get('osmc', [[0]])[0][0] > 0


def test_a_restarted_board_still_stops_at_an_obstacle(board):
    with Podcar(board.host_url) as podcar:
        podcar.says('press Enter')
        happen(board, 'reboot')  # the restarted board has lost the threshold of US 1
        board.next(lambda each: each.get('happened') == 'reboot')
        # When the program requests its state fields again, the program has detected the restart.
        board.next(lambda each: each.get('executed', {}).get('command', '').startswith('F:'))
        podcar.enter()
        board.next(is_driven)
        happen(board, 'us 1 100')
        board.state('SAFE', 'proximity')
        podcar.says('proximity')
        assert podcar.process.wait(PATIENCE_S) == 3


def test_the_podcar_is_not_armed_in_front_of_an_obstacle(board):
    happen(board, 'us 1 100')
    with Podcar(board.host_url) as podcar:
        podcar.says('press Enter')
        board.state('SAFE', 'proximity')
        podcar.enter()
        podcar.says('proximity')
        assert podcar.process.wait(PATIENCE_S) == 3
    assert not any(each.get('outputs', {}).get('relays') for each in board.log)


def test_an_enter_typed_before_the_question_is_ignored(board):
    with Podcar(board.host_url, typed=b'\n') as podcar:
        podcar.says('press Enter')
        with pytest.raises(AssertionError, match='nothing of that kind'):
            board.next(lambda each: each.get('outputs', {}).get('relays'), timeout=1)
        podcar.enter()
        board.next(is_driven)
        podcar.process.send_signal(signal.SIGINT)
        podcar.says('ended')
