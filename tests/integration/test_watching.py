# SPDX-License-Identifier: GPL-3.0-or-later
"""Programs that watch a board, alone or beside a driving program, in either order of start."""
import itertools
import signal
import socket

import pytest

from lan import Lan
from machine import within
from r4_process import Board, driving, is_state, run, watch


@pytest.fixture(name='board')
def a_board():
    with Board('udp://127.0.0.1:0') as board:
        yield board


def drives(each):
    return is_state(each) and each['fields'].get('OSMC1') == [358, 1]


def is_safe_for_the_link(each):
    return is_state(each) and each['fields'].get('SAFE') == 1


def test_monitor_shows_a_board_without_a_controlling_host(board):
    with watch(board.host_url) as watcher:
        watcher.next(is_safe_for_the_link)
        watcher.skip_past()
        times = [watcher.next(is_state)['t'] for _ in range(100)]
        assert sorted(times) == times and 900 <= times[-1] - times[0] <= 1300
    assert not [each for each in board.log if each.get('state') == 'ACTIVE']


def test_the_first_steps_of_the_help_work_as_printed():
    """Uses the two ports of the protocol, on a computer where no other program uses these ports."""
    with Lan() as lan:
        inside = lan.computer('10.77.0.1').inside
        with Board('udp://127.0.0.1', **inside):
            with watch('udp://127.0.0.1', **inside) as watcher:
                watcher.next(is_state)
                sent = run('send', 'udp://127.0.0.1', 'R:1,On', 'O:358,1,1', '--hold', '0.5', **inside)
                assert sent.returncode == 0, sent.stderr
                watcher.next(drives)
            with driving('udp://127.0.0.1', 'O:358,1,1', **inside), watch('udp://127.0.0.1', **inside) as watcher:
                watcher.next(drives)


def test_suspended_and_killed_watchers_do_not_disturb_the_host(board):
    with driving(board.host_url, 'O:358,1,1'), watch(board.host_url) as frozen:
        frozen.next(drives)
        frozen.signal(signal.SIGSTOP)
        for _ in range(3):
            with watch(board.host_url, '--fields', 'ENC1,US1') as watcher:
                fields = watcher.next(is_state)['fields']
                assert set(fields) == {'ENC1', 'US1'}
                watcher.process.kill()
        board.never('SAFE', 2.5)
        frozen.signal(signal.SIGCONT)
        frozen.skip_past()
        frozen.next(drives)


def test_a_fifth_watcher_is_refused_until_another_watcher_ends(board):
    watchers = [watch(board.host_url) for _ in range(4)]
    try:
        for each in watchers:
            each.next(is_state)
        refused = run('monitor', board.host_url, '--duration', '1')
        assert 'the board has reached its limit of watchers' in refused.stdout + refused.stderr, refused
        assert watchers.pop().end() == 0
        with watch(board.host_url) as next_one:
            next_one.next(is_state)
    finally:
        for each in watchers:
            each.__exit__()


def test_a_watcher_finds_the_board_again_after_a_restart():
    with Board('udp://127.0.0.1:0', options=['--stdin'], stdin=-1) as board, watch(board.host_url) as watcher:
        watcher.next(is_safe_for_the_link)
        board.process.stdin.write('reboot\n')
        board.process.stdin.flush()
        board.next(lambda each: 'happened' in each)
        watcher.skip_past()
        watcher.next(is_safe_for_the_link)


def test_a_watcher_on_a_cable_loses_no_state(tmp_path):
    with Board(f'pty:{tmp_path}/r4', 'udp://127.0.0.1:0') as board:
        cable, network = [each['host_url'] for each in board.log if each.get('type') == 'listening'][:2]
        with watch(cable) as watcher:
            watcher.next(is_safe_for_the_link)
            with driving(network + '?listen=0', 'O:358,1,1'):
                watcher.next(drives)
            watcher.next(is_safe_for_the_link)
            # The watcher's own events, such as a change of its link, have no number.
            numbers = [watcher.next(lambda each: each.get('pnum') is not None)['pnum'] for _ in range(50)]
            steps = [b - a for a, b in itertools.pairwise(numbers)]
            # At 100 Hz, the board drops a state that has waited at a serial port for 30 ms.
            waited = 100 * within(0)
            assert max(steps) <= 2 + waited and sum(steps) < 60 + waited, 'more than the numbers of answers are missing'


def test_the_configured_peer_gets_only_heartbeats_beside_a_watcher(board):
    del board
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as standing:
        standing.bind(('127.0.0.1', 0))
        standing.settimeout(1)
        with Board(f'udp://127.0.0.1:0?peer=127.0.0.1:{standing.getsockname()[1]}') as paired, \
                watch(paired.host_url) as watcher:
            for _ in range(100):
                watcher.next(is_state)
            standing.setblocking(False)
            heard = []
            try:
                while True:
                    heard.append(standing.recv(2000).decode())
            except BlockingIOError:
                pass
            assert heard and all(each.startswith('H:R4-ROS2;PNum:0;T:0;') for each in heard), heard[:5]
