# SPDX-License-Identifier: GPL-3.0-or-later
"""r4link.Wiring, and the wiring of a board."""
import asyncio

import pytest

import r4link
from r4link import testing


def test_a_wiring_is_read_changed_checked_and_written(tmp_path):
    wiring = r4link.Wiring.plan()
    assert len(wiring.SIGNALS) == 101 and wiring['stepper 1 step'] == 'D2' and wiring['relay 8'] == 'GPB7'
    wiring['handle'] = 'D53 low'
    wiring['encoder 4 index'] = 'none'
    wiring.check()
    path = tmp_path / 'robot.wiring'
    path.write_text(str(wiring))
    assert r4link.Wiring.load(path) == wiring == r4link.Wiring.read(path.read_text())
    assert r4link.Wiring.plan().differences(wiring) == [('handle', 'D42', 'D53 low'), ('encoder 4 index', 'D32', 'none')]
    assert wiring != r4link.Wiring.plan()


def test_a_fault_names_the_signal_the_reason_and_the_fix():
    wiring = r4link.Wiring.plan()
    with pytest.raises(r4link.DataError, match="'D103' is not a valid place"):
        wiring['handle'] = 'D103'
    with pytest.raises(r4link.DataError, match='step 1: is not a valid signal'):
        wiring['step 1'] = 'D2'
    wiring['handle'] = 'D20'
    with pytest.raises(r4link.DataError) as raised:
        wiring.check()
    assert (raised.value.thing, raised.value.reason) == ('handle', 'D20 belongs to an I2C bus')
    with pytest.raises(r4link.DataError, match='robot.wiring:2: handle'):
        r4link.Wiring.read('r4-wiring 1\nhandle = D103\n', 'robot.wiring')
    with pytest.raises(r4link.OpenError):
        r4link.Wiring.load('/nowhere/robot.wiring')


def test_a_board_keeps_a_wiring_for_its_next_start(tmp_path):
    wiring = r4link.Wiring.plan()
    wiring['stepper 1 step'] = 'D47'
    with testing.SimProcess(f'pty:{tmp_path}/r4') as sim, r4link.Board(sim.url) as board:
        board.wait_active()
        kept = board.wiring()
        assert (kept.source, kept.in_use, kept.wiring) == ('plan', True, r4link.Wiring.plan())
        board.give_wiring(wiring)
        kept = board.wiring()
        assert (kept.source, kept.in_use, kept.wiring) == ('given', False, wiring)
        wiring['handle'] = 'D20'
        with pytest.raises(r4link.DataError):
            board.give_wiring(wiring)
        assert board.wiring().wiring['handle'] == 'D42'


def test_asyncio_has_the_same(tmp_path):
    async def main(url):
        async with r4link.aio.Board(url) as board:
            await board.wait_active()
            await board.give_wiring(r4link.Wiring.plan())
            return await board.wiring()

    with testing.SimProcess(f'pty:{tmp_path}/r4') as sim:
        assert asyncio.run(main(sim.url)).source == 'given'


def test_a_wiring_is_taken_over_a_cable_only():
    with testing.SimProcess('udp://127.0.0.1:0') as sim, r4link.Board(sim.url) as board:
        board.wait_active()
        with pytest.raises(r4link.RefusedError, match='USB'):
            board.give_wiring(r4link.Wiring.plan())


def test_a_board_without_a_handle_says_so(tmp_path):
    wiring = r4link.Wiring.plan()
    wiring['handle'] = 'none'
    (tmp_path / 'none.wiring').write_text(str(wiring))
    with testing.SimProcess('udp://127.0.0.1:0', '--wiring', str(tmp_path / 'none.wiring')) as sim:
        with r4link.Board(sim.url) as board:
            board.wait_active()
            assert board.next_state().dmhsta is None
