# SPDX-License-Identifier: GPL-3.0-or-later
"""A board with two CAN buses."""
from inside import run_inside


def test_a_board_on_two_buses():
    run_inside('can_wires_inside.py')
