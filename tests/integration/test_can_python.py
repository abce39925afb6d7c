# SPDX-License-Identifier: GPL-3.0-or-later
"""r4 on CAN against a host and a board on python-can."""
from inside import run_inside


def test_r4_against_a_host_and_a_board_on_python_can():
    run_inside('can_python_inside.py')
