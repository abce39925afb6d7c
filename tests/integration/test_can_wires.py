# SPDX-License-Identifier: GPL-3.0-or-later
"""A board with two CAN buses; r4 bridge between UDP and a CAN bus; can_test: our ISO-TP engine, what reads SocketCAN.

In one guest, and what of the tests on CAN runs under a sanitizer, too.
"""
from inside import run_inside


def test_two_buses_a_bridge_to_one_and_the_engine():
    run_inside('can_wires_inside.py', 'can_bridge_inside.py', 'can_isotp_inside.py')
