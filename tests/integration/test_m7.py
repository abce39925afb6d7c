# SPDX-License-Identifier: GPL-3.0-or-later
"""The board's firmware on an emulated Cortex-M7 (tools/m7) and r4 as the host, by UART and by UDP."""
import itertools
import os
import signal
import socket

import pytest

from m7_board import M7Board, Relay, Watcher, m7, steps_of
from machine import within_ms
from r4_process import PATIENCE_S, driving, is_link, is_state, monitor, objects, run

SAFE_WITHIN_MS = 1020


@pytest.fixture(scope='module', name='urls')
def running_board():
    """One board, which runs during all tests, as a real board does."""
    with M7Board() as board:
        yield board


@pytest.fixture(params=['serial', 'udp'], name='url')
def either_url(urls, request):
    return getattr(urls, request.param)


marks = itertools.cycle(['ENC1', 'ENC2'])


def states_of(url, count):
    """Returns `count` states in a row, after the choice of fields. Until the board receives the
    choice, the board sends the fields that the previous host chose, so each call chooses another field."""
    mark = next(marks)
    with monitor(url, '--fields', f'LATE,{mark}') as host:
        host.next(is_link('active'))
        host.next(lambda each: is_state(each) and mark in each['fields'])
        return [host.next(is_state) for _ in range(count)]


def test_streams_at_100_hz_with_nothing_lost(url):
    steps = steps_of(states_of(url, 200), 10)
    assert sum(steps) < within_ms(2 * 10 * len(steps))


def test_streams_at_1000_hz_over_udp_with_nothing_lost(urls):
    """On a busy machine the board leaves states out, and reports them. tests/m7/board_state_test.cpp has the exact bound."""
    assert run('send', urls.udp, 'C:rate,1000').returncode == 0
    steps = steps_of(states_of(urls.udp, 2000), 1)
    assert run('send', urls.udp, 'C:rate,100').returncode == 0
    assert sum(steps) < within_ms(2 * len(steps))


def test_every_kind_of_command_is_executed(url):
    commands = ['O:1,1,4', 'D:2,0,4', 'S:2500,16', 'R:8,On', 'P:-100,500,4', 'Z:4', 'B:4095,1,1,4',
                'O:1,1,1;O:2,1,2;S:1500,3', 'U:10,4', 'F:ENC1',
                'C:rate,50', 'C:rate,100', 'C:recovery,last', 'Q:ID', 'E:STOP', 'E:CLEAR']
    result = run('send', url, *commands, '--json')
    assert result.returncode == 0, result
    assert [(each['command'], each['confirmed']) for each in objects(result.stdout)] == [
        (command, True) for command in commands]


def test_states_report_setpoints_until_the_board_is_stopped(urls):
    with driving(urls.serial, 'O:358,1,1', 'S:1500,1') as host:
        # A host that does not control the board watches its broadcasts.
        with Watcher(urls.udp) as watcher:
            state = watcher.next(lambda fields: fields.get('OSMC1') == '358,1')
            assert state['SERVO1POS'] == '1500'
            stopped = run('stop', urls.udp)
            assert stopped.returncode == 0, stopped
            print(stopped.stdout.splitlines()[0])
            watcher.ask()  # makes this watcher the newest peer from which the board has received
            watcher.next(lambda fields: fields.get('OSMC1') == '0,0' and fields.get('SAFE') == '2')
    assert run('send', urls.serial, 'E:CLEAR').returncode == 0


def test_commands_are_refused_while_a_stop_is_latched(url):
    assert run('stop', url).returncode == 0
    refused = run('send', url, 'O:358,1,1')
    assert refused.returncode == 3 and 'E:CLEAR' in refused.stderr, refused
    assert run('send', url, 'E:CLEAR', 'O:358,1,1').returncode == 0


def test_a_key_given_over_the_uart_is_required_over_udp(urls, tmp_path):
    key = str(tmp_path / 'key')
    assert run('key', 'new', key).returncode == 0
    given = run('key', 'give', key, urls.serial)
    assert given.returncode == 0, given.stderr
    try:
        # The session on the UART has to end first.
        signed = run('send', urls.udp, 'O:358,1,1', 'E:STOP', 'E:CLEAR', 'O:358,1,1', '--key', key, timeout=30)
        assert signed.returncode == 0, signed.stderr
        refused = run('send', urls.udp, 'O:1,1,1', '--timeout', '2.5')
        assert refused.returncode == 3 and '--key FILE' in refused.stderr, refused
        assert run('stop', urls.udp).returncode == 0
    finally:
        assert run('send', urls.serial, 'E:CLEAR', 'C:key,1:off').returncode == 0
    assert run('send', urls.udp, 'O:358,1,1').returncode == 0


def test_the_board_is_safe_in_time_after_its_host_is_killed(urls):
    with Relay(urls.udp) as relay:
        with driving(relay.url, 'O:358,1,1') as host:
            relay.safe = None
            relay.went_safe.clear()
            host.signal(signal.SIGKILL)
        assert relay.went_safe.wait(PATIENCE_S)
        silence = (int(relay.safe['T']) - relay.heartbeat_t) % 2**32
    print(f'safe {silence} ms after the last heartbeat, by the board\'s clock')
    assert silence >= 1000
    assert silence <= within_ms(SAFE_WITHIN_MS)
    # The next host finds the outputs off, and can switch them on again.
    with monitor(urls.udp) as host:
        host.next(is_link('active'))
        assert host.next(is_state)['fields']['OSMC1'] == [0, 0]
    assert run('send', urls.udp, 'O:358,1,1').returncode == 0


def test_the_outputs_are_off_while_the_host_is_suspended(urls):
    with driving(urls.serial, 'O:358,1,1') as host:
        with Watcher(urls.udp) as watcher:
            watcher.next(lambda fields: fields.get('OSMC1') == '358,1')
            host.signal(signal.SIGSTOP)
            watcher.next(lambda fields: 'H' in fields and fields.get('SAFE') == '1')
            host.signal(signal.SIGCONT)
            watcher.next(lambda fields: fields.get('OSMC1') == '358,1')


def test_an_unread_serial_port_does_not_delay_states_over_udp(urls):
    unread = os.open(urls.serial[len('serial://'):], os.O_RDWR | os.O_NOCTTY)
    try:
        steps_of(states_of(urls.udp, 150), 10)
        # The board has sent far more than the line can hold, so the next states are new.
        assert run('stop', urls.serial).returncode == 0
        assert run('send', urls.serial, 'E:CLEAR').returncode == 0
    finally:
        os.close(unread)


def test_a_port_in_use_is_reported():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(('127.0.0.1', 0))
        result = m7('--udp', str(taken.getsockname()[1]))
    assert result.returncode == 4 and '--udp picks another port' in result.stderr
