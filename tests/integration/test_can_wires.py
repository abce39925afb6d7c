# SPDX-License-Identifier: GPL-3.0-or-later
"""A board with two CAN buses; r4 bridge between UDP and a CAN bus; can_test: our ISO-TP engine, what reads SocketCAN.

In one guest, and what of the tests on CAN runs under a sanitizer, too: but for two buses, where programs that a
sanitizer slows down in a guest do not keep the times that are asserted.
"""
from inside import run_inside
from r4_process import SANITIZED

WIRES = [] if SANITIZED else ['can_wires_inside.py']


def test_two_buses_a_bridge_to_one_and_the_engine():
    run_inside(*WIRES, 'can_bridge_inside.py', 'can_isotp_inside.py')
