# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults of a CAN bus, of its controllers and of those at its ends."""
from inside import run_inside


def test_faults_of_a_can_bus():
    # slcan is the guest's: few kernels have it loaded.
    run_inside('can_faults_inside.py')
