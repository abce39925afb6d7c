# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that test_can.py runs where SocketCAN exists: lost and late frames, and ends that disconnect.

netem loses and delays frames on the pair vxcan0, vxcan1.
"""
import collections
import contextlib
import itertools
import re
import signal
import subprocess
import time

from can_inside import EMERGENCY, PATIENTLY, SLOWLY, Dump, in_control
from r4_process import Board, Running, is_state, monitor, objects, run

BOARD, HOST = 'can://vxcan0?node=2', 'can://vxcan1?node=2'
COMMAND_OF_2 = '182'


@contextlib.contextmanager
def netem(*how, ends=('vxcan0', 'vxcan1')):
    """Applies the netem options `how` to each frame that leaves the `ends`."""
    for interface in ends:
        subprocess.run(['tc', 'qdisc', 'add', 'dev', interface, 'root', 'netem', 'limit', '10000', *how],
                       check=True)
    try:
        yield
    finally:
        for interface in ends:
            subprocess.run(['tc', 'qdisc', 'del', 'dev', interface, 'root'], check=True)


def test_a_confirmed_command_is_executed_exactly_once():
    commands = [f'S:{1000 + i},{1 + i % 16}' for i in range(20)]
    with netem('loss', '5%', 'delay', '2ms'), Board(BOARD, options=PATIENTLY) as board, \
            Dump(f'vxcan1,{COMMAND_OF_2}:7FF') as dump:
        result = run('send', HOST, '--json', '--timeout', '10', *commands, timeout=200)
        executed = [each['executed'] for each in board.rest() if 'executed' in each]
    results = [each for each in objects(result.stdout) if each['type'] == 'result']
    told = ['confirmed' if each['confirmed'] else each['reason'] for each in results]
    # The first frames of commands (docs/reference/packed.md, layout 7), except the command F that the host sends first.
    firsts = [data for _, data in dump.frames if re.match('10..B8', data)]
    begun = sum(first != firsts[0] for first in firsts)
    print(f'{told.count("confirmed")} of {len(commands)} confirmed, begun {begun} times')
    assert begun > len(told), 'no command was repeated'
    pnums = [each['pnum'] for each in executed]
    assert len(pnums) == len(set(pnums))
    times = collections.Counter(each['command'] for each in executed)
    # Ten heartbeats in a row may be lost. r4 send ends at the first command that is not confirmed.
    for command, outcome in itertools.zip_longest(commands, told, fillvalue='not sent'):
        if outcome == 'confirmed':
            assert times[command] == 1, (command, outcome)
        elif outcome.startswith('not confirmed'):
            assert times[command] <= 1, (command, outcome)
        else:
            assert outcome.startswith(('refused', 'not sent')) and times[command] == 0, (command, outcome)


# A filter for candump: frames whose 29-bit id begins with the id of the emergency stop.
NUMBERED_STOPS = f'{EMERGENCY << 18:08x}:{0x7FF << 18:08x}'


def test_a_lost_stop_is_repeated_until_the_board_confirms_it():
    with Board(BOARD, options=PATIENTLY) as board, monitor(HOST) as host, \
            Dump(f'vxcan1,{NUMBERED_STOPS}') as sent, Dump(f'vxcan0,{NUMBERED_STOPS}') as arrived:
        in_control(host)
        with netem('loss', '100%', ends=['vxcan1']):
            stop = Running('stop', HOST, '--timeout', '20')
            sent.more(5)
            assert stop.process.poll() is None and not arrived.frames
        board.state('SAFE', 'stop')
        with stop:
            assert stop.wait() == 0, stop.errors
        arrived.more(1 - len(arrived.frames))
    print(f'{len(sent.frames)} sent, {len(arrived.frames)} arrived')


def test_a_board_or_host_killed_within_a_transfer_can_be_restarted():
    url = 'can://vcan0?node=4'
    plain = url + '&pack=0'
    options = ('--set', 'rate,500')  # a state has 26 frames, so a frame is always in transfer
    with contextlib.ExitStack() as first:
        board = first.enter_context(Board(url, options=SLOWLY))
        host = first.enter_context(monitor(plain))
        in_control(host)
        for _ in range(2):
            board.signal(signal.SIGKILL)
            board.wait()
            board = first.enter_context(Board(url, options=options))
            since = time.monotonic()
            board.state('ACTIVE', timeout=20)
            print(f'streams {(time.monotonic() - since) * 1000:.0f} ms after the board restarted')
            for _ in range(3):
                host.next(is_state)
        host.signal(signal.SIGKILL)
        host.wait()
        board.state('SAFE', 'link')
        result = run('send', plain, 'O:358,1,1', timeout=60)
        assert result.returncode == 0, result
