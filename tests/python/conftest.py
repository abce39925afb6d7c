# SPDX-License-Identifier: GPL-3.0-or-later
import pathlib
import sys
import time

import pytest

import r4link

sys.path.append(str(pathlib.Path(__file__).resolve().parents[1] / 'integration'))
import own_network  # noqa: E402
from repeat import pytest_runtest_protocol  # noqa: E402, F401

own_network.enter()

PATIENCE_S = 10


@pytest.fixture(name='sim')
def a_simulated_board():
    return r4link.SimBoard()


@pytest.fixture(name='board')
def under_control(sim):
    with r4link.Board(sim.url) as board:
        board.wait_active()
        yield board


@pytest.fixture(name='wait')
def until():
    def wait(done):
        deadline = time.monotonic() + PATIENCE_S
        while not done():
            assert time.monotonic() < deadline, 'the condition did not become true in time'
            time.sleep(0.005)
    return wait
