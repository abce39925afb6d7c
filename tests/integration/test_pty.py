# SPDX-License-Identifier: GPL-3.0-or-later
"""A simulated board and hosts as separate processes over a pseudo-terminal, which replaces USB."""
import os
import pty
import random
import re
import signal
import threading
import time
import tty

import pytest

from machine import within, within_ms
from r4_process import Board, driving, is_link, is_state, monitor, objects, run, watch

SAFE_WITHIN_MS = 1020


@pytest.fixture(name='path')
def link_path(tmp_path):
    return str(tmp_path / 'board')


@pytest.fixture(name='board')
def running_board(path):
    with Board(f'pty:{path}') as board:
        yield board


def test_a_pty_without_a_file_name_reports_its_device():
    with Board('pty:') as board:
        assert board.url.startswith('pty:/dev/pts/')
        assert run('monitor', board.host_url, '--count', '5').returncode == 0


@pytest.mark.parametrize('url', ['udp://127.0.0.1:0', 'pty:'])
def test_the_next_host_need_not_wait_for_the_timeout(url):
    with Board(url) as each:
        assert run('send', each.host_url, 'C:timeout,10000').returncode == 0
        for pwm in (358, 359, 360):
            assert run('send', each.host_url, f'O:{pwm},1,1', timeout=5).returncode == 0
            each.outputs(lambda outputs, pwm=pwm: outputs['osmc'][0] == [pwm, 1])
            each.state('SAFE', 'link')


def test_list_reports_a_port_without_a_board(tmp_path):
    path = tmp_path / 'nothing'
    listed = run('list', '--serial', path)
    assert listed.returncode == 0, listed
    assert f'no R4 board answered at serial://{path}\n    the device does not exist; ' in listed.stdout, listed.stdout


def listed(path):
    """The report of r4 list on the pty of a board."""
    result = run('list', '--serial', path, '--json')
    return next(each for each in objects(result.stdout) if each.get('path') == path)


def test_list_shows_the_name_and_the_holder_of_a_board(tmp_path):
    path = str(tmp_path / 'tty')
    with Board(f'pty:{path}', options=['--board-id', 'b-1', '--set', 'name,left']) as board:
        url = board.host_url
        free = listed(path)
        assert (free['board_id'], free['name'], free['busy']) == ('b-1', 'left', False), free
        assert free['url'] == url and re.fullmatch(r'\d+\.\d+\.\d+', free['firmware']), free
        assert 'held_by' not in free, free
        with watch(url) as watcher:
            watcher.next(is_state)
            watched = listed(path)
            assert (watched['board_id'], watched['busy']) == ('b-1', False), watched
            assert watched['held_by'] == {'program': 'r4', 'pid': watcher.process.pid, 'controls': False}
        with driving(url, 'O:358,1,1') as host:
            driven = listed(path)
            assert (driven['board_id'], driven['name'], driven['busy']) == ('b-1', 'left', True), driven
            assert driven['held_by'] == {'program': 'r4', 'pid': host.process.pid, 'controls': True}
            text = run('list', '--serial', path).stdout
            assert re.search(rf'R4 board: {url}  id b-1, name left, firmware .*, '
                             rf'controlled by r4 \(pid {host.process.pid}\)\n', text), text
            board.never('SAFE', 0.1)
        missing = listed(path + '-2')
        assert missing['fix'] and 'board_id' not in missing, missing


def test_network_settings_are_accepted_only_over_the_cable(board):
    assert run('send', board.host_url, 'C:network,My%2CNet', 'C:password,12345678').returncode == 0
    assert run('send', board.host_url, 'C:password,short').returncode == 2
    with Board('udp://127.0.0.1:0') as other:
        refused = run('send', other.host_url, 'C:network,mine')
        assert refused.returncode == 3 and 'USB' in refused.stderr


def test_a_second_host_is_refused_but_can_stop_the_board(board):
    with monitor(board.host_url) as host:
        host.next(is_state)
        refused = run('send', board.host_url, 'O:1,1,1')
        assert refused.returncode == 3 and f'(pid {host.process.pid})' in refused.stderr
        assert run('stop', board.host_url).returncode == 0
        board.state('SAFE', 'stop')
        host.next(is_state)


def test_the_board_is_safe_in_time_after_its_host_is_killed(board):
    with driving(board.host_url, 'O:358,1,1') as host:
        board.outputs(lambda outputs: outputs['osmc'][0] == [358, 1])
        killed = host.signal(signal.SIGKILL)
        board.outputs(lambda outputs: outputs['osmc'][0] == [0, 0])
        safe = board.state('SAFE', 'link')
    print(f"safe {safe['silence']} ms after the last heartbeat, "
          f"{(safe['came'] - killed) * 1000:.0f} ms after the kill")
    assert safe['silence'] <= within_ms(SAFE_WITHIN_MS)


def test_the_board_is_safe_in_time_while_its_host_is_suspended(board):
    with driving(board.host_url, 'O:358,1,1') as host:
        host.signal(signal.SIGSTOP)
        safe = board.state('SAFE', 'link')
        print(f"safe {safe['silence']} ms after the last heartbeat")
        assert 1000 <= safe['silence'] <= within_ms(SAFE_WITHIN_MS)
        host.signal(signal.SIGCONT)
        board.outputs(lambda outputs: outputs['osmc'][0] == [358, 1])
        board.state('ACTIVE')


def test_a_session_goes_on_when_the_board_is_plugged_in_again(board, path):
    with monitor(board.host_url) as host:
        host.next(is_link('active'))
        unplugged = board.signal(signal.SIGKILL)
        lost = host.next(lambda each: each['type'] == 'link' and not each['fields']['up'])
        assert lost['came'] - unplugged < within(0.05)
        with Board(f'pty:{path}') as again:
            back = host.next(is_link('active'))
            assert back['came'] - again.log[-1]['came'] < within(1.05)
            host.next(is_state)
            print(f"told after {(lost['came'] - unplugged) * 1000:.1f} ms, "
                  f"back after {(back['came'] - again.log[-1]['came']) * 1000:.1f} ms")
        host.next(lambda each: each['type'] == 'link' and not each['fields']['up'])


def test_a_new_host_begins_with_the_outputs_off(board):
    with driving(board.host_url, 'O:358,1,1') as host:
        host.signal(signal.SIGKILL)
    board.state('SAFE', 'link')
    with monitor(board.host_url) as host:
        host.next(is_link('active'))
        assert host.next(is_state)['fields']['OSMC1'] == [0, 0]


def garbage(size):
    return random.Random(7).randbytes(size)


def test_a_board_recovers_from_a_host_with_another_baud_rate(board):
    device = os.open(board.host_url[len('serial://'):], os.O_RDWR | os.O_NOCTTY)
    for _ in range(20):
        os.write(device, garbage(1000))
    os.close(device)
    with monitor(board.host_url, '--fields', 'RXCRC') as host:
        host.next(is_link('active'))
        state = host.next(lambda each: is_state(each) and 'RXCRC' in each['fields'])
        print(f"RXCRC {state['fields']['RXCRC']}")
        assert state['fields']['RXCRC'] > 10 and state['fields'].get('SAFE') == 0


class Noise:
    """A device that sends at another bit rate, so that a host reads garbage."""

    def __enter__(self):
        self.master, slave = pty.openpty()
        tty.setraw(slave)
        self.path = os.ttyname(slave)
        self.slave = slave
        self.going = True
        self.thread = threading.Thread(target=self.talk)
        self.thread.start()
        return self

    def talk(self):
        os.set_blocking(self.master, False)
        while self.going:
            for act in (lambda: os.write(self.master, garbage(500)), lambda: os.read(self.master, 4096)):
                try:
                    act()
                except BlockingIOError:
                    time.sleep(0.001)

    def __exit__(self, *_):
        self.going = False
        self.thread.join()
        os.close(self.master)
        os.close(self.slave)


def test_a_host_reports_a_different_baud_rate():
    with Noise() as device:
        result = run('monitor', f'serial://{device.path}', '--json', '--duration', '0.5')
    assert result.returncode == 3
    assert 'datagrams were damaged' in result.stderr and 'same baud rate' in result.stderr
    assert '"type":"error"' in result.stdout and '"type":"state"' not in result.stdout
