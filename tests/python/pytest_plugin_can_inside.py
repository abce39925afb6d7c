# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that integration/test_can.py runs where SocketCAN exists: the pytest plugin, with the example of testing.md."""
from test_pytest_plugin import run_step, steps


def test_the_example_passes_on_a_can_bus(tmp_path):
    run_step(steps()[-1], tmp_path, 'test_bus.py')
