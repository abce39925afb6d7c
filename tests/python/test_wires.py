# SPDX-License-Identifier: GPL-3.0-or-later
"""Boards of several wires: one of them is pulled and plugged in again while a program drives."""
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

RELAY = pathlib.Path(__file__).resolve().parents[1] / 'support' / 'wire_relay.py'
LONGEST_GAP_S = 0.1  # states come every 10 ms


class Pty:
    """A cable between a host and a board."""

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


@pytest.fixture(name='wires')
def udp_and_pty(tmp_path):
    """The URLs of a board's two wires, and the cable of the second."""
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
    return [wire.state for wire in board.wires]


def test_one_is_pulled_and_plugged_in_again_while_the_program_drives(wires, wait):
    urls, cable = wires
    told, links = [], []
    with r4link.Board(urls) as board:
        board.on_wire(lambda wire: told.append((wire.state, time.monotonic())))
        board.wait_active()
        wait(lambda: states_of(board) == ['carrying', 'carrying'])
        board.arm()
        board.on_link(lambda link: links.append((link.state, link.carrying)))
        states = board.states(lossless=True)
        ages = []

        def drive(until):
            while not until():
                board.servo(1).set(1000 + len(ages) % 1000)
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
        drive(lambda: board.wires[1].copies + board.wires[0].copies > 20)
        statistics, first = board.statistics, board.wires[0]
    gap = max(later - earlier for earlier, later in zip(ages, ages[1:]))
    print(f'longest gap {gap * 1e3:.0f} ms, told of the loss after {lost * 1e3:.0f} ms, used again after '
          f'{back * 1e3:.0f} ms')
    assert lost <= within(0.05) and back <= within(1.5) and gap <= within(LONGEST_GAP_S)
    assert {state for state, _ in links} == {'active'} and (0, 1) in [carrying for _, carrying in links]
    assert statistics.refused == statistics.timed_out == 0 and statistics.confirmed > 10
    assert first.loss == 0 and first.round_trip_us > 0 and first.board_id == 'sim-1' and first.as_dict()['busy'] is False


def test_asyncio_has_them_too_and_a_text_joins_them(wires):
    urls, cable = wires

    async def main():
        async with aio.Board('+'.join(urls)) as board:
            lost = asyncio.Event()
            await board.wait_active()
            board.on_wire(lambda wire: wire.state == 'down' and lost.set())
            await board.arm()
            cable.pull()
            await asyncio.wait_for(lost.wait(), 10)
            await board.servo(2).set(1500)
            assert len(board.wires) == 2 and board.wires[0].state == 'carrying'
            cable.plug_in()
    asyncio.run(main())


def test_a_fleet_has_boards_of_several(wires):
    urls, _ = wires
    with r4link.Fleet('+'.join(urls)) as fleet:
        fleet.wait_active()
        [health] = fleet.health()
        assert health.url == '+'.join(urls) and len(health.wires) == 2 and health.well


def test_what_cannot_be_is_refused(sim):
    with pytest.raises(r4link.UsageError, match='a board of its own'):
        r4link.Board([sim.url, 'udp://127.0.0.1'])
    with pytest.raises(r4link.UsageError, match='one to 4 are possible'):
        r4link.Board([f'udp://127.0.0.{i}' for i in range(1, 6)])
    with pytest.raises(r4link.UsageError, match='a board of one wire'):
        r4link.Board([r4link.with_link('udp://127.0.0.1', 'loss=5%'), 'serial:auto'])
    with pytest.raises(r4link.UsageError):
        r4link.Board([])
