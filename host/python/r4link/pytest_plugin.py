# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixtures for tests of a robot's program (docs/how-to/testing.md):

    r4_robot    a simulated robot, for a program that opens its URL
    r4_board    a board of such a robot, under control, with expectations
    r4_bus      several such boards: @pytest.mark.r4(boards=3)
    r4_link     a board behind a bad link: @pytest.mark.r4(link='loss=5%,delay=20ms±10,seed=7');
                a failing test reports the link

The mark, @pytest.mark.r4(transport='udp'), or --r4-transport names the transport: sim (in this
process), udp, pty, can (a bus in the kernel, --r4-interface).
"""
from __future__ import annotations

import contextlib
import os
import pathlib
import random
from typing import Any, Iterator

import pytest

from .errors import UsageError
from .testing import TRANSPORTS, Robot, SimProcess, TestBoard, make_robot


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup('r4link')
    group.addoption('--r4-transport', choices=TRANSPORTS, default='sim',
                    help='the transport of simulated R4 boards (sim)')
    group.addoption('--r4-interface', default='vcan0', help='the CAN interface of --r4-transport can (vcan0)')


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line('markers', 'r4(transport, boards, link, **options): where the simulated boards are, how '
                                       'many r4_bus has, what is wrong with the link of r4_link, and options of '
                                       'r4link.Board')


def _node(number: int) -> int:
    """The node of board `number`, from 0, on a bus that all workers of pytest-xdist share."""
    workers = int(os.environ.get('PYTEST_XDIST_WORKER_COUNT', '1'))
    worker = int(os.environ.get('PYTEST_XDIST_WORKER', 'gw0').removeprefix('gw'))
    node = 1 + worker + number * workers
    if node > 31:
        raise UsageError(f'board {number + 1} of a test of {workers} pytest workers', 'a CAN bus has the nodes 1 to 31',
                         'use fewer workers (-n) or fewer boards')
    return node


def _marked(request: pytest.FixtureRequest) -> dict[str, Any]:
    mark = request.node.get_closest_marker('r4')
    return dict(mark.kwargs) if mark else {}


@contextlib.contextmanager
def _robot(request: pytest.FixtureRequest, folder: pathlib.Path, number: int, link: str = '') -> Iterator[Robot]:
    config = request.config
    transport = _marked(request).get('transport', config.getoption('--r4-transport'))
    if link and transport == 'sim':
        transport = 'udp'
    node = _node(number) if transport == 'can' else 1 + number
    robot = make_robot(transport, folder, interface=config.getoption('--r4-interface'), node=node, link=link)
    try:
        yield robot
    finally:
        if isinstance(robot, SimProcess):
            robot.close()


@contextlib.contextmanager
def _board(request: pytest.FixtureRequest, robot: Robot) -> Iterator[TestBoard]:
    options = {name: value for name, value in _marked(request).items() if name not in ('transport', 'boards', 'link')}
    with TestBoard(robot.url, **options) as board:
        board.robot = robot
        board.wait_active()
        yield board


@pytest.fixture
def r4_robot(request: pytest.FixtureRequest, tmp_path: pathlib.Path) -> Iterator[Robot]:
    """A simulated robot: `url` for the program under test, happen(), look()."""
    with _robot(request, tmp_path, 0) as robot:
        yield robot


@pytest.fixture
def r4_board(request: pytest.FixtureRequest, r4_robot: Robot) -> Iterator[TestBoard]:
    """A board under control of the test, not armed yet."""
    with _board(request, r4_robot) as board:
        yield board


@pytest.fixture
def r4_link(request: pytest.FixtureRequest, tmp_path: pathlib.Path) -> Iterator[TestBoard]:
    """A board behind the mark's bad link, or behind a link with a little loss, delay and a random seed."""
    link = _marked(request).get('link') or f'loss=2%,delay=5ms±5,seed={random.randrange(1 << 32)}'
    request.node.add_report_section('setup', 'r4_link', f"@pytest.mark.r4(link='{link}')")
    with _robot(request, tmp_path, 0, link) as robot, _board(request, robot) as board:
        yield board


@pytest.fixture
def r4_bus(request: pytest.FixtureRequest, tmp_path: pathlib.Path) -> Iterator[list[TestBoard]]:
    """Several boards under control of the test: two, or the number in the mark."""
    with contextlib.ExitStack() as stack:
        yield [stack.enter_context(_board(request, stack.enter_context(_robot(request, tmp_path, number))))
               for number in range(_marked(request).get('boards', 2))]
