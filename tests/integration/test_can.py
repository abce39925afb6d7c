# SPDX-License-Identifier: GPL-3.0-or-later
"""The link over CAN: boards and hosts as processes on buses; r4 doctor with interfaces that are set up wrong; r4
against a host and a board on python-can; buses that lose frames; faults of a bus, of its controllers and of the
programs at its ends; a board with two buses; r4 bridge; our ISO-TP engine and the code that reads SocketCAN
(can_test); the pytest plugin; tools/with-can on a kernel that has CAN.

All tests run in one guest, because its start takes ten seconds. Under a sanitizer only a part of them runs:
the other tests assert times that a slow program in a guest does not keep.
"""
from inside import PACKAGE, run_inside
from machine import SANITIZED

ALWAYS = ['can_bridge_inside.py', 'can_isotp_inside.py']
# slcan needs the guest: few kernels have its module loaded.
UNSANITIZED = ['can_inside.py', 'can_doctor_inside.py', 'can_python_inside.py', 'can_loss_inside.py',
               'can_faults_inside.py', 'can_paths_inside.py', 'with_can_inside.py']
PYTHON = ['../python/pytest_plugin_can_inside.py'] if PACKAGE.is_dir() else []


def test_the_can_tests_pass_in_a_guest():
    run_inside(*ALWAYS, *([] if SANITIZED else UNSANITIZED + PYTHON))
