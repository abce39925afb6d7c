# SPDX-License-Identifier: GPL-3.0-or-later
"""The link over CAN: runs can_inside.py where SocketCAN is, here or in the guest of tools/with-can.

A run in which those tests were not executed fails.
"""
import pathlib
import re
import subprocess

HERE = pathlib.Path(__file__).resolve().parent
WITH_CAN = HERE.parents[1] / 'tools' / 'with-can'


def test_the_link_over_can():
    inside = subprocess.run(
        [WITH_CAN, '--time', '240', '/usr/bin/python3', '-m', 'pytest', HERE / 'can_inside.py', '-q',
         '-ra', '-s', '-p', 'no:cacheprovider'], stdin=subprocess.DEVNULL, capture_output=True, text=True,
        timeout=290, check=False)
    print(inside.stdout)
    written = len(re.findall(r'^def test_', (HERE / 'can_inside.py').read_text(), re.MULTILINE))
    passed = re.search(r'(\d+) passed', inside.stdout)
    assert inside.returncode == 0, inside.stdout[-4000:] + inside.stderr
    assert passed and int(passed[1]) >= written and 'skipped' not in inside.stdout
