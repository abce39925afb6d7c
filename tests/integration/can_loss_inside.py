# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that test_can.py runs where SocketCAN exists: lost, late and corrupt frames, and ends that disconnect.

netem loses and delays frames on the pair vxcan0, vxcan1. cangw corrupts frames that it carries from vcan0 to vcan1.
"""
import collections
import contextlib
import re
import signal
import socket
import struct
import subprocess
import time
import zlib

import pytest

from can_inside import EMERGENCY, PATIENTLY, SLOWLY, Dump, in_control, ip
from r4_process import Board, Running, is_link, is_state, lasts, monitor, objects, run

BOARD, HOST = 'can://vxcan0?node=2', 'can://vxcan1?node=2'
COMMAND_OF_2 = '182'
TELEMETRY = 0x400
NODE = 4
COMMAND, REPLY = 0x180 + NODE, 0x200 + NODE


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


def executed(log):
    return [each['executed'] for each in log if 'executed' in each]


def told_of(results, commands):
    """The result of each command by r4 send, which ends at the first command that is not confirmed."""
    told = ['confirmed' if each['confirmed'] else each['reason'] for each in results if each['type'] == 'result']
    return told + ['not sent'] * (len(commands) - len(told))


def agrees_with_the_board(told, commands, log):
    """A confirmed command was executed once, an unconfirmed command at most once, and an unsent command never."""
    pnums = [each['pnum'] for each in executed(log)]
    assert len(pnums) == len(set(pnums))
    times = collections.Counter(each['command'] for each in executed(log))
    for command, outcome in zip(commands, told):
        if outcome == 'confirmed':
            assert times[command] == 1, (command, outcome)
        elif outcome.startswith('not confirmed'):
            assert times[command] <= 1, (command, outcome)
        else:
            assert outcome.startswith(('refused', 'not sent')) and times[command] == 0, (command, outcome)


@pytest.mark.parametrize('loss, count', [('1%', 20), ('5%', 20)])
def test_a_confirmed_command_is_executed_exactly_once(loss, count):
    commands = [f'S:{1000 + i},{1 + i % 16}' for i in range(count)]
    with netem('loss', loss, 'delay', '2ms'), Board(BOARD, options=PATIENTLY) as board, \
            Dump(f'vxcan1,{COMMAND_OF_2}:7FF') as dump:
        result = run('send', HOST, '--json', '--timeout', '10', *commands, timeout=200)
        log = board.rest()
    told = told_of(objects(result.stdout), commands)
    # The first frames of commands (docs/reference/packed.md, layout 7), except the command F that the host sends first.
    firsts = [data for _, data in dump.frames if re.match('10..B8', data)]
    begun = sum(first != firsts[0] for first in firsts)
    print(f'{told.count("confirmed")} of {count} confirmed, begun {begun} times')
    agrees_with_the_board(told, commands, log)
    if loss == '1%':
        assert result.returncode == 0 and told == ['confirmed'] * count, result
    else:  # ten heartbeats in a row may be lost
        assert begun > count - told.count('not sent'), 'no command was repeated'


def test_send_reports_an_unconfirmed_command_and_sends_none_after_it():
    commands = [f'S:{1000 + i},{1 + i % 16}' for i in range(300)]
    with Board(BOARD, options=SLOWLY) as board, \
            Running('send', HOST, '--json', '--timeout', '3', *commands) as sender:
        board.executed(commands[3])
        with netem('loss', '100%'):
            assert sender.wait() == 3
            while sender.next()['confirmed']:
                pass
            board.state('SAFE', 'link')
        log = board.rest()
    told = told_of(sender.log, commands)
    print(next(each for each in told if each != 'confirmed'))
    agrees_with_the_board(told, commands, log)
    assert sum(each.startswith('not confirmed within 3') for each in told) == 1 and told[-1] == 'not sent', told


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


class Gateway:
    """Joins vcan0 and vcan1 to one bus, and corrupts frames on request."""

    def __init__(self):
        ip('link', 'add', 'vcan1', 'type', 'vcan')
        ip('link', 'set', 'vcan1', 'mtu', '72', 'up')
        self.carry()

    def carry(self, *changes):
        subprocess.run(['cangw', '-F'], check=True, capture_output=True)
        for source, target in (('vcan0', 'vcan1'), ('vcan1', 'vcan0')):
            subprocess.run(['cangw', '-A', '-s', source, '-d', target, '-e', *changes], check=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        subprocess.run(['cangw', '-F'], check=True, capture_output=True)
        ip('link', 'del', 'vcan1')


@pytest.mark.parametrize('form, corrupt', [('plain', (0, 3, 6)), ('packed', (1, 4, 7))])
def test_a_corrupt_command_is_never_executed(form, corrupt):
    host_url = f'can://vcan1?node={NODE}' + ('&pack=0' if form == 'plain' else '')
    commands = [f'S:{1000 + i},{1 + i % 16}' for i in range(400)]
    with Gateway() as gateway, Board(f'can://vcan0?node={NODE}', options=PATIENTLY) as board:
        with Running('send', host_url, '--timeout', '20', '--json', *commands) as sender, Dump('vcan1') as dump:
            board.executed(commands[0], timeout=20)
            for byte in corrupt:  # the index in the eight bytes of a frame
                mask = bytearray(8)
                mask[byte] = 0x01 if byte % 2 == 0 else 0x20
                gateway.carry('-m', f'XOR:D:0.0.{mask.hex().upper()}')
                dump.more(25)
                gateway.carry()
                dump.more(15)
            sender.signal(signal.SIGKILL)
        log = board.rest()
    ours = executed(log)
    assert len({each['pnum'] for each in ours}) == len(ours)
    servos = [each['command'] for each in ours if each['command'].startswith('S:')]
    others = {each['command'] for each in ours} - set(servos)
    print(f'{len(servos)} commands executed through {len(corrupt)} kinds of corruption, none of them a corrupt one')
    assert servos == commands[:len(servos)]
    assert all(each.startswith(('F:', 'Q:', 'E:LEAVE')) for each in others), others
    widths = {us for each in log if 'outputs' in each for us in each['outputs']['servo']}
    assert widths <= {0, *range(997, 1403)}  # one count of the PWM chip is 4.88 us


class RawHost:
    """A host on vcan0 with its own ISO-TP, so that it can end within a transfer."""

    def __init__(self):
        self.socket = socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self.socket.bind(('vcan0',))
        self.socket.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, struct.pack('=II', REPLY, 0x7FF))
        self.socket.settimeout(5)
        self.pnum = 1

    def heartbeat(self):
        body = f'H:ROS2-R4;PNum:{self.pnum};T:{self.pnum};^'.encode()
        self.pnum += 1
        return body + f'0x{zlib.crc32(body):x}^'.encode()

    def frame(self, data):
        self.socket.send(struct.pack('=IB3x8s', COMMAND, len(data), data))

    def send(self, datagram, frames=99):
        """Sends at most `frames` frames of a datagram, and waits for flow control after the first frame."""
        self.frame(bytes([0x10, len(datagram)]) + datagram[:6])
        while self.socket.recv(16)[8] >> 4 != 3:
            pass
        parts = [datagram[at:at + 7] for at in range(6, len(datagram), 7)]
        for number, part in enumerate(parts[:frames - 1], 1):
            self.frame(bytes([0x20 | number % 16]) + part)

    def close(self):
        self.socket.close()


@pytest.mark.parametrize('break_off', ['falls silent', 'interface down', 'begins anew'])
def test_the_board_accepts_the_datagram_after_an_incomplete_one(break_off):
    with Board(f'can://vcan0?node={NODE}', options=SLOWLY) as board, contextlib.closing(RawHost()) as host:
        host.send(host.heartbeat(), frames=3)
        if break_off == 'falls silent':
            lasts(0.2)  # N_Cr is 100 ms
        elif break_off == 'interface down':
            ip('link', 'set', 'vcan0', 'down')
            board.next(lambda each: each.get('transport', {}).get('event') == 'down')
            ip('link', 'set', 'vcan0', 'up')
            board.next(lambda each: each.get('transport', {}).get('event') == 'up')
            with contextlib.suppress(OSError):
                host.socket.recv(16)  # fails once, because the interface was down
        since = time.monotonic()
        host.send(host.heartbeat())
        active = board.state('ACTIVE')
        print(f'{break_off}: obeyed {(active["came"] - since) * 1000:.0f} ms after the next was begun')


def test_a_board_or_host_killed_within_a_transfer_can_be_restarted():
    url = f'can://vcan0?node={NODE}'
    plain = url + '&pack=0'
    options = ('--set', 'rate,500')  # a state has 26 frames, so a frame is always in transfer
    with monitor_of_several(url, plain) as host:
        for _ in range(2):
            with Board(url, options=options) as board:
                board.state('ACTIVE', timeout=20)
                for _ in range(3):
                    host.next(is_state)
                board.signal(signal.SIGKILL)
                board.wait()
        with Board(url, options=options) as board:
            since = time.monotonic()
            board.state('ACTIVE', timeout=20)
            print(f'streams {(time.monotonic() - since) * 1000:.0f} ms after the board began again')
            host.signal(signal.SIGKILL)
            host.wait()
            board.state('SAFE', 'link')
            result = run('send', plain, 'O:358,1,1', timeout=60)
            assert result.returncode == 0, result
    kinds = collections.Counter(each['type'] for each in host.log)
    print(dict(kinds))


@contextlib.contextmanager
def monitor_of_several(url, host_url):
    with Board(url, options=SLOWLY) as board, monitor(host_url) as host:
        in_control(host)
        board.signal(signal.SIGKILL)
        board.wait()
        yield host
