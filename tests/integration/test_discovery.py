# SPDX-License-Identifier: GPL-3.0-or-later
"""Discovery of boards: r4 list, udp:auto and udp:?id=NAME on a network with several computers."""
import contextlib
import re
import time

import pytest

from lan import Lan
from r4_process import ERROR, Board, driving, is_link, is_state, monitor, objects, run

USAGE, REFUSED, OPEN = 2, 3, 4


@pytest.fixture(name='lan')
def a_lan():
    with Lan() as lan:
        lan.host = lan.computer('10.77.0.1')
        yield lan


@pytest.fixture(name='boards')
def boards_on_it(lan):
    """Returns a function that puts a simulated board on the LAN, at a new computer."""
    with contextlib.ExitStack() as stack:
        def add(address, board_id, *options):
            computer = lan.computer(address)
            board = stack.enter_context(Board('udp://0.0.0.0:2018', **computer.inside,
                                              options=['--board-id', board_id, *options]))
            board.computer = computer
            return board

        yield add


def found(computer, *options):
    """The boards that r4 list finds by UDP from that computer, by their addresses."""
    result = run('list', '--json', *options, **computer.inside)
    assert result.returncode == 0, result
    networks = [each for each in objects(result.stdout) if each['type'] == 'udp']
    return {board['address']: board for network in networks for board in network['boards']}


def test_list_shows_each_board_with_name_url_and_whether_it_is_busy(lan, boards):
    boards('10.77.0.2', 'b-2', '--set', 'name,left')
    boards('10.77.0.3', 'b-3', '--set', 'name,right')
    boards('10.77.0.4', 'b-4')
    # If a program holds the port of hosts, other programs can search nevertheless.
    with monitor('udp:?id=right', **lan.host.inside) as host:
        host.next(is_link('active'))
        listed = found(lan.host)
        assert {address: (each['board_id'], each['name'], each['busy'], each['url'])
                for address, each in listed.items()} == {
            '10.77.0.2': ('b-2', 'left', False, 'udp:?id=left'),
            '10.77.0.3': ('b-3', 'right', True, 'udp:?id=right'),
            '10.77.0.4': ('b-4', '', False, 'udp:?id=b-4')}
        assert all(re.fullmatch(r'\d+\.\d+\.\d+', each['firmware']) for each in listed.values())
        text = run('list', **lan.host.inside).stdout
        assert re.search(r'R4 board: udp:\?id=left +at 10\.77\.0\.2, id b-2, name left, .*, free\n', text), text
        assert re.search(r'udp:\?id=right +at .*, controlled by a host\n', text), text
        host.next(is_state)
    for address, each in listed.items():
        result = run('send', each['url'] + '&listen=0', 'Q:ID', '--json', **lan.host.inside)
        assert objects(result.stdout)[0]['board_id'] == each['board_id'], (address, result)


def test_udp_auto_opens_the_only_board(lan, boards):
    nothing = run('send', 'udp:auto', 'Q:ID', **lan.host.inside)
    assert nothing.returncode == OPEN and ERROR.search(nothing.stderr), nothing
    assert 'no R4 board answered (asked on lo, r4lan)' in nothing.stderr
    only = boards('10.77.0.2', 'b-2')
    with driving('udp:auto', 'O:358,1,1', **lan.host.inside):
        only.outputs(lambda outputs: outputs['osmc'][0] == [358, 1])
        begun = time.monotonic()
        assert run('stop', 'udp:auto?listen=0', **lan.host.inside).returncode == 0
        print(f'stopped after {time.monotonic() - begun:.2f} s')
        only.state('SAFE', 'stop')
    boards('10.77.0.3', 'b-3', '--set', 'name,right')
    for command in (['send', 'udp:auto', 'Q:ID'], ['monitor', 'udp:auto'], ['bench', 'udp:auto']):
        several = run(*command, **lan.host.inside)
        assert several.returncode == USAGE and ERROR.search(several.stderr), several
        assert 'udp:?id=b-2 (10.77.0.2)' in several.stderr and 'udp:?id=right (10.77.0.3)' in several.stderr


def test_a_host_finds_a_board_again_at_a_new_address(lan, boards):
    board = boards('10.77.0.2', 'b-2', '--set', 'name,left')
    boards('10.77.0.3', 'b-3')
    with monitor('udp:?id=left', **lan.host.inside) as host:
        host.next(is_state)
        board.computer.move('10.77.0.9')
        host.next(is_link('lost'))
        host.next(lambda each: each['type'] == 'error' and
                  each['fields'].get('reason') == 'the board is at 10.77.0.9 now; it was at 10.77.0.2')
        host.next(is_link('active'))
        state = host.next(is_state)
        assert state['transport'].startswith('udp://10.77.0.9')
    board.state('SAFE', 'link')
    board.state('ACTIVE')


def test_a_board_accepts_a_name_only_over_its_cable(lan, tmp_path):
    path = tmp_path / 'board'
    inside = lan.host.inside
    with Board(f'pty:{path}', 'udp://127.0.0.1:2018', **inside) as board:
        def name():
            return found(lan.host)['127.0.0.1']['name']

        cable = f'serial://{path}'
        refused = run('send', 'udp:auto', 'C:name,left', **inside)
        assert refused.returncode == REFUSED and 'USB' in refused.stderr, refused
        assert name() == ''
        assert run('send', cable, 'C:name,left', **inside).returncode == 0
        assert name() == 'left'
        named = run('send', cable, 'Q:ID', **inside)
        assert 'board sim-1 (left), firmware' in named.stdout, named
        for wrong in ('n' * 300, 'n' * 32, 'a b', 'a.b', 'ä', ''):
            result = run('send', cable, f'C:name,{wrong}', **inside)
            assert result.returncode == USAGE and ERROR.search(result.stderr), (wrong, result)
            assert '1-31 letters, digits, _ and -' in result.stderr
        assert name() == 'left'
        board.skip_past()
        assert run('send', cable, 'C:name,off', **inside).returncode == 0
        assert board.executed('C:name,off') and name() == ''


def test_a_board_at_another_port_is_found_with_the_option_port(lan):
    with Board('udp://127.0.0.1:2019', **lan.host.inside):
        assert found(lan.host) == {}
        assert found(lan.host, '--port', '2019')['127.0.0.1']['url'] == 'udp:?id=sim-1&port=2019'
        assert run('send', 'udp:auto?port=2019', 'R:1,On', **lan.host.inside).returncode == 0
