# SPDX-License-Identifier: GPL-3.0-or-later
"""The link over CAN: boards and hosts as processes on buses; r4 doctor and interfaces that are not set up as they should
be; r4 against a host and a board on python-can; buses that lose frames; faults of a bus, of its controllers and of those
at its ends; a board with two buses; r4 bridge; our ISO-TP engine and the code that reads SocketCAN (can_test); the pytest
plugin; tools/with-can on a kernel that has CAN.

All in one guest, because it takes ten seconds until the first test runs in it. Under a sanitizer only a part of them:
the others assert times that a slow program in a guest does not keep.
"""
from inside import PACKAGE, run_inside
from machine import SANITIZED

ALWAYS = ['can_bridge_inside.py', 'can_isotp_inside.py']
# slcan is the guest's: few kernels have it loaded.
UNSANITIZED = ['can_inside.py', 'can_doctor_inside.py', 'can_python_inside.py', 'can_loss_inside.py',
               'can_faults_inside.py', 'can_paths_inside.py', 'with_can_inside.py']
PYTHON = ['../python/pytest_plugin_can_inside.py'] if PACKAGE.is_dir() else []


def test_the_link_over_can():
    run_inside(*ALWAYS, *([] if SANITIZED else UNSANITIZED + PYTHON))
