# SPDX-License-Identifier: GPL-3.0-or-later
"""The pytest plugin on a CAN bus, by the example of docs/testing.md: in the guest where this kernel has none."""
from test_pytest_plugin import run_step, steps


def test_the_example_passes_on_a_can_bus(tmp_path):
    run_step(steps()[-1], tmp_path)
