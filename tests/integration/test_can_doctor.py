# SPDX-License-Identifier: GPL-3.0-or-later
"""r4 doctor and CAN interfaces that really are as they should not be."""
from inside import run_inside


def test_what_is_wrong_with_can_interfaces():
    run_inside('can_doctor_inside.py')
