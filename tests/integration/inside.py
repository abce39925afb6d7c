# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs test files where SocketCAN is: in the guest of tools/with-can, or here if this is it.

Nowhere else: on a machine's own CAN interfaces there may be motors.
A run in which one of their tests was not executed fails.
"""
import os
import pathlib
import re
import subprocess

HERE = pathlib.Path(__file__).resolve().parent
TOOL = HERE.parents[1] / 'tools' / 'with-can'
# The guest has two processors, and beside it runs the board that is emulated in real time (m7_board.py): it waits.
WITH_CAN = [TOOL] if 'R4_CAN_GUEST' in os.environ else ['nice', '-n', '10', TOOL, '--guest']


# The longest takes five minutes. The machine may be three times as slow as usual, and was.
LONGEST_S = 900


def run_inside(*names):
    """`names`: files beside this one."""
    files = [HERE / name for name in names]
    inside = subprocess.run(
        [*WITH_CAN, '--time', str(LONGEST_S), '/usr/bin/python3', '-m', 'pytest', *files, '-q', '-ra',
         '-s', '-p', 'no:cacheprovider', '--durations=20'], stdin=subprocess.DEVNULL, capture_output=True, text=True,
        timeout=LONGEST_S + 50, check=False)
    print(inside.stdout)
    written = sum(len(re.findall(r'^def test_', file.read_text(), re.MULTILINE)) for file in files)
    passed = re.search(r'(\d+) passed', inside.stdout)
    assert inside.returncode == 0, inside.stdout[-6000:] + inside.stderr
    assert passed and int(passed[1]) >= written and 'skipped' not in inside.stdout
