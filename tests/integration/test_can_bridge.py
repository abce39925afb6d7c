# SPDX-License-Identifier: GPL-3.0-or-later
"""r4 bridge between UDP and a CAN bus, as processes."""
from inside import run_inside


def test_a_bridge_to_a_bus():
    run_inside('can_bridge_inside.py')
