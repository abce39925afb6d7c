# SPDX-License-Identifier: GPL-3.0-or-later
"""A CAN bus that loses, repeats, exchanges and changes frames."""
from inside import run_inside


def test_a_can_bus_that_loses_frames():
    run_inside('can_loss_inside.py')
