# SPDX-License-Identifier: GPL-3.0-or-later
"""r4 bridge as a process, with hosts on one transport and their board on another transport."""
import signal
import socket
import time

import pytest

from machine import SANITIZED, within
from paper_client import PaperClient
from r4_process import ERROR, Board, Running, again, driving, is_state, lasts, monitor, run, watch

# The board's timeout with the margin of docs/reference/safety.md, then a margin for a busy machine.
SAFE_WITHIN_S = 1.02 + 0.08
LASTS_S = 2


class Bridge(Running):
    """A running r4 bridge. `url`: where the bridge listens."""

    def __init__(self, hosts, board, *options):
        super().__init__('bridge', hosts, board, '--json', '--every', '0.1', *options)
        self.url = self.next(lambda each: each['type'] == 'bridge')['hosts']
        self.host_url = self.url + '?listen=0'

    def transport(self, side, event):
        return self.next(lambda each: each['type'] == 'transport' and each['side'] == side and each['event'] == event)

    def counters(self, side, is_it=lambda each: True):
        return self.next(lambda each: each['type'] == 'counters' and each['side'] == side and is_it(each))


@pytest.fixture(name='tty')
def a_path(tmp_path):
    return tmp_path / 'r4'


@pytest.fixture(name='board')
def at_a_serial_port(tty):
    with Board(f'pty:{tty}') as board:
        board.tty = tty
        yield board


@pytest.fixture(name='bridge')
def from_udp_to_it(board):
    with Bridge('udp://127.0.0.1:0', f'serial://{board.tty}') as bridge:
        yield bridge


def test_the_papers_udp_client_drives_a_board_on_a_serial_port(board):
    listening = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sending = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    listening.bind(('127.0.0.1', 0))
    listening.settimeout(0.1)
    peer = f'127.0.0.1:{listening.getsockname()[1]}'
    with listening, sending, Bridge(f'udp://127.0.0.1:0?peer={peer}', f'serial://{board.tty}') as bridge:
        port = int(bridge.url.split('?')[0].rsplit(':', 1)[1])
        # On a busy machine some datagrams are late, but no datagram is lost.
        fates = ('passed', 'late', 'undelivered', 'kept_out')
        client = PaperClient(lambda data: sending.sendto(data, ('127.0.0.1', port)))
        # The first datagram of the board shows the bridge that the board has no key.
        bridge.counters('board', lambda each: each['passed'] or each['undelivered'])
        end = time.monotonic() + LASTS_S
        while time.monotonic() < end:
            try:
                client.take(listening.recv(1024))
            except TimeoutError:
                pass
        if not SANITIZED:
            bridge.counters('hosts', lambda each: sum(each[name] for name in fates) == client.pnum_sent)
        log = board.rest()
        told = bridge.rest()
    assert not [each for each in log if each.get('state') == 'SAFE'], 'safe although the client was connected'
    assert [each for each in log if each.get('state') == 'ACTIVE']
    assert len(client.states) >= 50 * LASTS_S or SANITIZED
    assert ';DHB1A:1000,1;' in client.states[-1] and ';SERVO1POS:300;' in client.states[-1]
    hosts = [each for each in told if each.get('side') == 'hosts' and each['type'] == 'counters'][-1]
    # The bridge may keep out some datagrams of the client before it serves the client.
    assert hosts['kept_out'] <= 16 or SANITIZED
    assert hosts['passed'] > 0.95 * client.pnum_sent
    assert hosts['damaged'] == hosts['misdirected'] == hosts['refused'] == 0


def test_hosts_drive_watch_and_stop_through_two_bridges(bridge, board):
    with Bridge('udp://127.0.0.1:0', bridge.host_url) as far:
        with driving(far.host_url, 'O:358,1,1'), watch(far.host_url) as watcher:
            watcher.next(lambda each: is_state(each) and each['fields'].get('OSMC1') == [358, 1])
            refused = run('send', far.host_url, 'O:1,1,1', '--timeout', '0.5')
            assert refused.returncode == 3 and ERROR.match(refused.stderr), refused.stderr
            assert run('stop', far.host_url).returncode == 0
            board.state('SAFE', 'stop')


def test_consecutive_sends_need_no_pause(bridge):
    for pwm in (100, 200, 300):
        sent = run('send', bridge.host_url, 'R:1,On', f'O:{pwm},1,1')
        assert sent.returncode == 0, sent.stderr


def test_a_bridge_reconnects_to_a_board_that_returns(tty):
    with Bridge('udp://127.0.0.1:0', f'serial://{tty}') as bridge:
        absent = bridge.transport('board', 'down')
        assert str(tty) in absent['thing'] and absent['fix']
        with monitor(bridge.host_url) as host:
            for _ in range(2):
                with Board(f'pty:{tty}'):
                    bridge.transport('board', 'up')
                    host.skip_past()
                    host.next(is_state)
                bridge.transport('board', 'down')


@pytest.mark.parametrize('end', ['bridge', 'host'])
def test_the_board_is_safe_in_time_when_host_or_bridge_is_killed(bridge, board, end):
    with driving(bridge.host_url, 'O:358,1,1') as host:
        board.outputs(lambda outputs: outputs['osmc'][0][0] == 358)
        board.skip_past()
        died = (bridge if end == 'bridge' else host).signal(signal.SIGKILL)
        safe = board.state('SAFE', 'link')
        assert safe['came'] - died <= within(SAFE_WITHIN_S)


def test_a_command_that_waited_in_a_suspended_bridge_is_not_executed(bridge, board):
    """The heartbeats of the paper's client have no echo, so the board cannot recognise the client's old datagrams."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sending:
        address = ('127.0.0.1', int(bridge.url.rsplit(':', 1)[1]))
        client = PaperClient(lambda data: sending.sendto(data, address))

        def drive():
            client.send_msg('H:ROS2-R4')
            client.send_msg('S:1000,1')
        again(drive, lambda timeout: board.executed('S:1000,1', timeout))
        bridge.signal(signal.SIGSTOP)
        board.state('SAFE', 'link')
        client.send_msg('H:ROS2-R4')
        client.send_msg('S:2000,1')
        lasts(0.2)
        bridge.skip_past()
        bridge.signal(signal.SIGCONT)
        late = bridge.counters('hosts', lambda each: each['late'] >= 2)
        assert late['passed'] < client.pnum_sent
        client.send_msg('H:ROS2-R4')
        board.state('ACTIVE')
        log = board.rest()
    assert not [each for each in log if each.get('executed', {}).get('command') == 'S:2000,1']


def test_by_default_a_bridge_listens_on_this_computer_only(board):
    with Bridge('udp://:0', f'serial://{board.tty}') as bridge:
        assert bridge.url.startswith('udp://127.0.0.1:')


def test_a_bridge_from_a_network_to_a_cable_needs_the_option_open(board):
    refused = run('bridge', 'udp://0.0.0.0:0', f'serial://{board.tty}')
    assert refused.returncode == 2 and ERROR.match(refused.stderr) and '--open' in refused.stderr
    with Bridge('udp://0.0.0.0:0', f'serial://{board.tty}', '--open') as bridge:
        warning = bridge.next(lambda each: each['type'] == 'transport' and each['event'] == 'warning')
        assert warning['side'] == 'hosts' and 'the bridge is open' in warning['reason']


def test_a_board_with_a_key_needs_the_key_in_bridge_and_host(tty, tmp_path):
    key = tmp_path / 'key'
    assert run('key', 'new', str(key)).returncode == 0
    with Board(f'pty:{tty}', options=('--set', f'key,{key.read_text().strip()}')):
        with Bridge('udp://127.0.0.1:0', f'serial://{tty}') as bridge:
            assert run('send', bridge.host_url, 'R:1,On', '--key', str(key), '--timeout', '1').returncode == 3
        with Bridge('udp://127.0.0.1:0', f'serial://{tty}', '--key', str(key)) as bridge:
            assert run('send', bridge.host_url, 'R:1,On', '--timeout', '1').returncode == 3
            signed = run('send', bridge.host_url, 'R:1,On', 'O:358,1,1', '--key', str(key))
            assert signed.returncode == 0, signed.stderr
            assert run('stop', bridge.host_url).returncode == 0


def test_a_bridge_does_not_pass_a_key(tty, tmp_path):
    key = tmp_path / 'key'
    assert run('key', 'new', str(key)).returncode == 0
    with Board('udp://127.0.0.1:0') as board:
        with Bridge(f'pty:{tty}', board.host_url) as bridge:
            given = run('key', 'give', str(key), f'serial://{tty}')
            assert given.returncode == 3 and ERROR.match(given.stderr), given.stderr
            assert bridge.counters('hosts', lambda each: each['refused'] > 0)


@pytest.mark.parametrize('hosts, to, code', [
    ('udp://127.0.0.1:2018', 'udp://127.0.0.1', 2),
    ('udp://192.0.2.1:2018', 'udp://127.0.0.1:2019', 4),
])
def test_a_bridge_that_cannot_open_its_urls_fails_with_one_line(hosts, to, code):
    ended = run('bridge', hosts, to)
    assert ended.returncode == code and ended.stdout == ''
    assert ERROR.fullmatch(ended.stderr.rstrip('\n')), ended.stderr


def test_a_bridge_reports_its_counters_in_readable_text(board):
    ended = run('bridge', 'udp://127.0.0.1:0', f'serial://{board.tty}', '--duration', '0.8', '--every', '0.1')
    assert ended.returncode == 0
    assert ended.stdout.count(' <-> ') == 1
    assert ': up\n' in ended.stderr and ' undelivered\n' in ended.stderr, ended.stderr
