# SPDX-License-Identifier: GPL-3.0-or-later
"""r4link.discover() and Board.first()."""
import asyncio
import os
import pickle

import pytest

import r4link
from r4link import aio

AT_THE_PORT_OF_BOARDS = 'udp://127.0.0.1:2018'


def path_of(sim):
    return sim.url.removeprefix('serial://')


def test_without_a_board_the_error_names_the_searched_networks():
    found = r4link.discover(serial=False, can=False)
    assert found.boards == [] and found.ports == [] and found.buses == [] and not found.more
    assert ('lo', '127.0.0.1', None) in [(each.interface, each.address, each.trouble) for each in found.networks]
    with pytest.raises(r4link.OpenError, match=r'no R4 board was found \(searched .*lo'):
        r4link.Board.first()


def test_the_only_board_is_found_and_opened():
    with r4link.SimBoard(AT_THE_PORT_OF_BOARDS, settings={'name': 'left'}):
        found = r4link.discover(serial=False, can=False)
        board = found.only()
        assert (board.url, board.place, board.address) == ('udp:?id=left', '127.0.0.1', '127.0.0.1')
        assert board.identity.name == 'left' and board.busy is False and board.holder is None
        assert pickle.loads(pickle.dumps(found)).only().identity.board_id == board.identity.board_id
        with r4link.Board.first(fields='DEFAULT,ENC1') as opened:
            opened.wait_active()
            assert opened.identify().name == 'left'
            assert r4link.discover(serial=False, can=False).only().busy is True


def test_with_several_boards_the_error_names_their_urls(tmp_path):
    with r4link.SimBoard(f'pty:{tmp_path}/left') as left, r4link.SimBoard(f'pty:{tmp_path}/right') as right:
        found = r4link.discover(udp=False, can=False, serial_ports=[path_of(left), path_of(right)])
        assert [board.url for board in found.boards] == [left.url, right.url]
        with pytest.raises(r4link.UsageError, match=f'open one of {left.url}, {right.url}'):
            found.only()


def test_a_controlled_board_names_its_holder(tmp_path):
    with r4link.SimBoard(f'pty:{tmp_path}/board') as sim, r4link.Board(sim.url) as driver:
        driver.wait_active()
        board = r4link.discover(udp=False, can=False, serial_ports=[path_of(sim)]).only()
        assert board.holder.pid == os.getpid() and board.holder.name
        assert board.holder_controls and board.busy is True


def test_a_port_without_a_board_has_a_reason(tmp_path):
    port, = [each for each in r4link.discover(udp=False, can=False, serial_ports=[f'{tmp_path}/none']).ports
             if each.path == f'{tmp_path}/none']
    assert port.asked and not port.is_r4 and 'does not exist' in port.trouble


def test_other_tasks_run_during_a_search():
    async def main():
        search = asyncio.create_task(aio.discover(serial=False, can=False))
        turns = 0
        while not search.done():
            turns += 1
            await asyncio.sleep(0.01)
        assert turns > 5
        assert (await search).only().identity.name == 'left'
        async with await aio.Board.first() as board:
            await board.wait_active()
    with r4link.SimBoard(AT_THE_PORT_OF_BOARDS, settings={'name': 'left'}):
        asyncio.run(main())
