# SPDX-License-Identifier: GPL-3.0-or-later
"""The link over CAN: boards and hosts as processes on buses; r4 doctor and interfaces that are as they should not be;
r4 against a host and a board on python-can; buses that lose frames; faults of a bus, of its controllers and of those
at its ends; tools/with-can on a kernel that has CAN.

In one guest: until the first test runs in it takes ten seconds.
"""
from inside import run_inside


def test_the_link_over_can():
    # slcan is the guest's: few kernels have it loaded.
    run_inside('can_inside.py', 'can_doctor_inside.py', 'can_python_inside.py', 'can_loss_inside.py',
               'can_faults_inside.py', 'with_can_inside.py')
