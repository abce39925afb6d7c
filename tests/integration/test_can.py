# SPDX-License-Identifier: GPL-3.0-or-later
"""The link over CAN: boards and hosts as processes on buses."""
from inside import run_inside


def test_the_link_over_can():
    run_inside('can_inside.py')
