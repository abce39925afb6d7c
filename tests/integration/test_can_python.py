# SPDX-License-Identifier: GPL-3.0-or-later
"""r4 on CAN against python-can: runs can_python_inside.py where SocketCAN is, here or in a guest.

A run in which those tests were not executed fails.
"""
import pathlib
import re
import subprocess

HERE = pathlib.Path(__file__).resolve().parent
WITH_CAN = HERE.parents[1] / 'tools' / 'with-can'


def test_r4_against_a_host_and_a_board_on_python_can():
    inside = subprocess.run(
        [WITH_CAN, '--time', '200', '/usr/bin/python3', '-m', 'pytest', HERE / 'can_python_inside.py', '-q',
         '-ra', '-s', '-p', 'no:cacheprovider'], stdin=subprocess.DEVNULL, capture_output=True, text=True,
        timeout=260, check=False)
    print(inside.stdout)
    written = len(re.findall(r'^def test_', (HERE / 'can_python_inside.py').read_text(), re.MULTILINE))
    passed = re.search(r'(\d+) passed', inside.stdout)
    assert inside.returncode == 0, inside.stdout[-6000:] + inside.stderr
    assert passed and int(passed[1]) >= written and 'skipped' not in inside.stdout
