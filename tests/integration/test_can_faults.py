# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults of a CAN bus: runs can_faults_inside.py and can_loss_inside.py where SocketCAN is.

A run in which those tests were not executed fails.
"""
import pathlib
import re
import subprocess

HERE = pathlib.Path(__file__).resolve().parent
WITH_CAN = HERE.parents[1] / 'tools' / 'with-can'
INSIDE = [HERE / 'can_faults_inside.py', HERE / 'can_loss_inside.py']


def test_faults_of_a_can_bus():
    # slcan is the guest's: few kernels have it loaded.
    inside = subprocess.run(
        [WITH_CAN, '--guest', '--time', '270', '/usr/bin/python3', '-m', 'pytest', *INSIDE, '-q', '-ra',
         '-s', '-p', 'no:cacheprovider'], stdin=subprocess.DEVNULL, capture_output=True, text=True,
        timeout=290, check=False)
    print(inside.stdout)
    written = sum(len(re.findall(r'^def test_', file.read_text(), re.MULTILINE)) for file in INSIDE)
    passed = re.search(r'(\d+) passed', inside.stdout)
    assert inside.returncode == 0, inside.stdout[-4000:] + inside.stderr
    assert passed and int(passed[1]) >= written and 'skipped' not in inside.stdout
