# SPDX-License-Identifier: GPL-3.0-or-later
"""Boards with several paths: one path is unplugged and plugged in again while a program drives."""
import asyncio
import json
import os
import pathlib
import subprocess
import sys
import time

import pytest

import r4link
from machine import within
from r4link import aio

RELAY = pathlib.Path(__file__).resolve().parents[1] / 'support' / 'relay.py'
LONGEST_GAP_S = 0.1  # states come every 10 ms


class Pty:
    """A pseudo-terminal as the cable between a host and a board."""

    def __init__(self, folder):
        self.ends = [f'{folder}/host', f'{folder}/board']
        self.process = None
        self.url = ''

    def plug_in(self):
        self.process = subprocess.Popen([sys.executable, '-S', RELAY, 'pty', *self.ends], stdout=subprocess.PIPE, text=True)
        self.url = self.process.stdout.readline().strip()

    def pull(self):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()


@pytest.fixture(name='paths')
def udp_and_pty(tmp_path):
    """The URLs of a board's two paths, and the cable of the second path."""
    cable = Pty(tmp_path)
    with subprocess.Popen([os.environ['R4'], 'sim', 'udp://127.0.0.1:0', f'pty:{tmp_path}/board', '--json'],
                          stdout=subprocess.PIPE, text=True) as sim:
        try:
            udp = json.loads(sim.stdout.readline())['host_url'] + '?listen=0'
            sim.stdout.readline()
            cable.plug_in()
            yield [udp, cable.url], cable
            cable.pull()
        finally:
            sim.kill()


def states_of(board):
    return [path.state for path in board.paths]


def test_a_program_drives_while_a_path_is_unplugged(paths, wait):
    urls, cable = paths
    told, links = [], []
    with r4link.Board(urls) as board:
        board.on_path(lambda path: told.append((path.state, time.monotonic())))
        board.wait_active()
        wait(lambda: states_of(board) == ['carrying', 'carrying'])
        board.arm()
        board.on_link(lambda link: links.append((link.state, link.carrying)))
        states = board.states(lossless=True)
        ages = []

        def drive(until):
            while not until():
                board.servo(1).set(us=1000 + len(ages) % 1000)
                while (state := states.take()) is not None:
                    ages.append(state.received)

        drive(lambda: len(ages) > 20)
        pulled = time.monotonic()
        cable.pull()
        drive(lambda: told and told[-1][0] != 'carrying')
        lost = told[-1][1] - pulled
        assert states_of(board) == ['carrying', 'down'] and board.link.carrying == (0,)
        plugged = time.monotonic()
        cable.plug_in()
        drive(lambda: told[-1][0] == 'carrying')
        back = told[-1][1] - plugged
        drive(lambda: board.paths[1].copies + board.paths[0].copies > 20)
        statistics, first = board.statistics, board.paths[0]
    gap = max(later - earlier for earlier, later in zip(ages, ages[1:]))
    print(f'longest gap {gap * 1e3:.0f} ms, told of the loss after {lost * 1e3:.0f} ms, used again after '
          f'{back * 1e3:.0f} ms')
    assert lost <= within(0.05) and back <= within(1.5) and gap <= within(LONGEST_GAP_S)
    assert {state for state, _ in links} == {'active'} and (0, 1) in [carrying for _, carrying in links]
    assert statistics.refused == statistics.timed_out == 0 and statistics.confirmed > 10
    assert first.loss == 0 and first.round_trip_us > 0 and first.board_id == 'sim-1' and first.as_dict()['busy'] is False


def test_asyncio_accepts_paths_joined_in_one_url(paths):
    urls, cable = paths

    async def main():
        async with aio.Board('+'.join(urls)) as board:
            lost = asyncio.Event()
            await board.wait_active()
            board.on_path(lambda path: path.state == 'down' and lost.set())
            await board.arm()
            cable.pull()
            await asyncio.wait_for(lost.wait(), 10)
            await board.servo(2).set(us=1500)
            assert len(board.paths) == 2 and board.paths[0].state == 'carrying'
            cable.plug_in()
    asyncio.run(main())


def test_a_fleet_has_boards_with_several_paths(paths):
    urls, _ = paths
    with r4link.Fleet('+'.join(urls)) as fleet:
        fleet.wait_active()
        [health] = fleet.health()
        assert health.url == '+'.join(urls) and len(health.paths) == 2 and health.well


def test_invalid_combinations_of_paths_are_refused(sim):
    with pytest.raises(r4link.UsageError, match='a separate board'):
        r4link.Board([sim.url, 'udp://127.0.0.1'])
    with pytest.raises(r4link.UsageError, match='one to 4 paths are possible'):
        r4link.Board([f'udp://127.0.0.{i}' for i in range(1, 6)])
    with pytest.raises(r4link.UsageError, match='only with one path'):
        r4link.Board([r4link.with_link('udp://127.0.0.1', 'loss=5%'), 'serial:auto'])
    with pytest.raises(r4link.UsageError):
        r4link.Board([])
