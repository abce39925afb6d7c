# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the tests that need SocketCAN: the link over CAN, the tools for CAN, and the pytest plugin.

All tests run in one guest, because its start takes ten seconds. Under a sanitizer only a part of the tests runs:
the other tests assert times that a slow program in a guest does not meet.
"""
from inside import PACKAGE, run_inside
from machine import SANITIZED

ALWAYS = ['can_bridge_inside.py', 'can_isotp_inside.py']
# slcan needs the guest, because few kernels have the module of slcan loaded.
UNSANITIZED = ['can_inside.py', 'can_doctor_inside.py', 'can_python_inside.py', 'can_loss_inside.py',
               'can_faults_inside.py', 'can_paths_inside.py', 'with_can_inside.py']
PYTHON = ['../python/pytest_plugin_can_inside.py'] if PACKAGE.is_dir() else []


def test_the_can_tests_pass_in_a_guest():
    run_inside(*ALWAYS, *([] if SANITIZED else UNSANITIZED + PYTHON))
