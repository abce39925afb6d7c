# SPDX-License-Identifier: GPL-3.0-or-later
"""Programs that share a transport: one user runs the programs in several terminals, on the same URL."""
import contextlib
import itertools
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import tempfile
import time

import pytest

from machine import within
from r4_process import (ERROR, PATIENCE_S, R4, Board, Running, driving, free_port, is_state, objects, run, stop_takes_ms,
                        wait_for, watch)

# Another program takes a path over within 100 ms. For a busy machine, the bound is double.
TAKEN_OVER_WITHIN_S = 0.2


@pytest.fixture(name='folder')
def where_anybody_may_look():
    with tempfile.TemporaryDirectory() as folder:
        os.chmod(folder, 0o755)
        yield folder


@pytest.fixture(name='board', params=['pty', 'udp'])
def on_a_path(request, folder):
    url = f'pty:{folder}/tty' if request.param == 'pty' else 'udp://127.0.0.1:0'
    with Board(url) as board:
        if request.param == 'udp':
            # All hosts use one port, as with the standard port of hosts.
            board.host_url = re.sub(r'\?listen=0$', f'?listen={free_port()}', board.host_url)
        yield board


def drives(pwm):
    return lambda each: is_state(each) and each['fields'].get('OSMC1') == [pwm, 1]


def is_safe(each):
    return is_state(each) and each['fields'].get('SAFE') == 1


def test_monitor_and_send_share_a_transport_in_any_order(board):
    with watch(board.host_url) as early:
        early.next(is_safe)
        for pwm in (100, 200, 300):
            sent = run('send', board.host_url, 'R:1,On', f'O:{pwm},1,1')
            assert sent.returncode == 0, sent.stderr
            early.next(drives(pwm))
        with driving(board.host_url, 'O:358,1,1') as host, watch(board.host_url) as late:
            late.next(drives(358))
            early.next(drives(358))
            host.end()
            late.next(is_safe)
        early.next(is_safe)
        early.skip_past()
        early.next(is_state)


def test_a_refusal_names_the_controlling_program_and_its_pid(board):
    with watch(board.host_url), driving(board.host_url, 'O:358,1,1') as host:
        for command in (['send', board.host_url, 'O:1,1,1'], ['monitor', board.host_url, '--control']):
            refused = run(*command)
            assert refused.returncode == 3, refused
            assert f'controlled by r4 (pid {host.process.pid})' in refused.stderr + refused.stdout
        board.never('SAFE', 0.3)


def test_a_stop_from_a_second_terminal_stops_the_board(board):
    with watch(board.host_url) as watcher, driving(board.host_url, 'O:358,1,1'):
        watcher.next(drives(358))
        stop_takes_ms(board.host_url)
        board.state('SAFE', 'stop')
        watcher.next(lambda each: is_state(each) and each['fields'].get('SAFE') == 2)


def received(path):
    """(time, number, datagram) of each datagram of the board in a recording."""
    lines = [line.split(' ', 2) for line in path.read_text('ascii').splitlines() if not line.startswith('#')]
    return [(float(came), int(re.search(r';PNum:([0-9]+);', datagram)[1]), datagram)
            for came, what, datagram in lines if what == '1<']


def from_to(datagrams, first, last):
    """The datagrams from the first with the text `first` to the next with the text `last`."""
    texts = [datagram for _, _, datagram in datagrams]
    begin = next(i for i, text in enumerate(texts) if first in text)
    return datagrams[begin:next(i for i, text in enumerate(texts) if i > begin and last in text)]


def test_recorders_lose_no_datagram_when_watchers_hang_or_are_killed(board, folder):
    paths = [pathlib.Path(folder, f'{i}.r4log') for i in range(3)]
    with contextlib.ExitStack() as running:
        sleeper, victim = [running.enter_context(watch(board.host_url)) for _ in range(2)]
        recorders = [running.enter_context(Running('record', board.host_url, '-o', str(path))) for path in paths]
        host = running.enter_context(driving(board.host_url, 'O:358,1,1'))
        for each in (sleeper, victim):
            each.next(drives(358))
        for path in paths:
            wait_for(path, 'OSMC1:358,1;')
        sleeper.signal(signal.SIGSTOP)
        victim.signal(signal.SIGKILL)
        board.never('SAFE', 2.5)  # by then the stopped program has lost the path
        sleeper.signal(signal.SIGCONT)
        sleeper.skip_past()
        sleeper.next(drives(358))
        killed, killed_at = host.signal(signal.SIGKILL), time.time()
        assert board.state('SAFE', 'link')['came'] - killed < within(1.1)
        for path, recorder in zip(paths, recorders):
            wait_for(path, '(?s)OSMC1:358,1;.*SAFE:1;')
            assert recorder.end() == 0, recorder.errors
    for path in paths:
        datagrams = from_to(received(path), 'OSMC1:358,1;', 'SAFE:1;')
        pairs = list(itertools.pairwise(datagrams))
        # Datagrams may be lost only between the death of the holder and the takeover of its path.
        holes = [(a, b) for a, b in pairs if b[1] != a[1] + 1]
        shown = [[(round(at - killed_at, 3), number) for at, number, _ in hole] for hole in holes]
        assert len(holes) <= 1 and all(b[0] > killed_at for _, b in holes), shown
        assert all(0 < b[1] - a[1] - 1 <= 100 * within(TAKEN_OVER_WITHIN_S) for a, b in holes), shown
        silence = max(b[0] - a[0] for a, b in pairs)
        assert silence <= within(TAKEN_OVER_WITHIN_S), f'{silence} s without a datagram'


def with_a_stopped_holder(url, look, watchers=2):
    """Stops a watcher that holds the transport, beside other watchers, and calls `look` for each other watcher."""
    with watch(url) as holder, contextlib.ExitStack() as running:
        holder.next(is_state)
        others = [running.enter_context(watch(url)) for _ in range(watchers)]
        for each in others:
            each.next(is_state)
        stopped = holder.signal(signal.SIGSTOP)
        for each in others:
            look(each, holder.process.pid, stopped)
        holder.signal(signal.SIGCONT)
        for each in (*others, holder):
            each.skip_past()
            each.next(is_state)


def hears_on(watcher, _, stopped):
    heard = watcher.next(lambda each: is_state(each) and each['came'] > stopped + 0.5)
    assert heard['came'] - stopped < within(2)


def test_a_suspended_holder_of_the_only_port_is_named():
    def is_told(watcher, pid, _):
        told = watcher.next(lambda each: each['type'] == 'error')['fields']
        assert f'the program that has it open (pid {pid}) does not answer' == told['reason'], told
    with Board('udp://127.0.0.1:0') as board:
        with_a_stopped_holder(board.host_url.replace('?listen=0', f'?listen={free_port()}'), is_told)


def test_a_suspended_watching_holder_does_not_block_a_board(folder):
    # Only one program can open a serial port, so only one watcher takes the port over from the stopped program.
    for url, watchers in ('udp://127.0.0.1:0', 2), (f'pty:{folder}/tty', 1):
        with Board(url) as board:
            with_a_stopped_holder(board.host_url.removesuffix('?listen=0'), hears_on, watchers)


def test_a_resumed_holder_takes_no_bytes_from_the_new_holder(folder):
    path = pathlib.Path(folder, 'all.r4log')
    with Board(f'pty:{folder}/tty') as board, watch(board.host_url) as holder:
        holder.next(is_state)
        holder.signal(signal.SIGSTOP)
        for _ in range(2):
            with driving(board.host_url, 'O:358,1,1') as host, \
                    Running('record', board.host_url, '-o', str(path)) as recorder:
                wait_for(path, 'OSMC1:358,1;')
                listed = run('list', '--json', '--serial', os.path.realpath(f'{folder}/tty')).stdout
                assert f'"pid":{host.process.pid},' in listed or f'"pid":{host.process.pid}}}' in listed, listed
                refused = run('send', board.host_url, 'O:1,1,1')
                assert refused.returncode == 3 and 'controlled by r4 ' in refused.stderr, refused
                holder.signal(signal.SIGCONT)
                holder.skip_past()
                for _ in range(20):
                    holder.next(drives(358))
                holder.signal(signal.SIGSTOP)  # a stopped program that shares the transport delays no other program
                assert recorder.end() == 0, recorder.errors
            numbers = [number for _, number, _ in received(path)]
            assert len(numbers) > 20 and numbers == sorted(set(numbers))
            # A delayed board leaves whole states out.
            [told] = objects(run('info', '--json', str(path)).stdout)
            assert told['paths'][0]['damaged'] == 0, told
            path.unlink()


def test_two_spellings_of_one_address_share_a_path():
    with Board('udp://127.0.0.1:0') as board:
        listen = free_port()
        url = board.host_url.replace('?listen=0', f'?listen={listen}')
        other_url = url.replace('127.0.0.1', 'localhost')
        with driving(url, 'O:358,1,1') as host, watch(other_url) as watcher:
            watcher.next(drives(358))
            refused = run('send', other_url, 'O:1,1,1')
            assert refused.returncode == 3, refused
            assert f'controlled by r4 (pid {host.process.pid})' in refused.stderr, refused
            # An address that needs a resolver is another path, at the same port.
            refused = run('send', url.replace('127.0.0.1', '127.1'), 'O:1,1,1')
            assert refused.returncode == 4, refused
            assert f'UDP port {listen} is in use by r4 (pid {host.process.pid})' in refused.stderr, refused


def test_stop_and_control_work_at_the_limit_of_sharing_programs(folder):
    with Board(f'pty:{folder}/tty') as board, watch(board.host_url) as holder, contextlib.ExitStack() as others:
        holder.next(is_state)
        for _ in range(16):
            other = others.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET))
            other.connect(f'\0r4link/{os.geteuid()}/serial/{os.path.realpath(folder + "/tty")}')
            other.send(b'h3')
            assert other.recv(2000) == b'w3'
        told = run('monitor', board.host_url, '--duration', '0.5')
        assert '16 programs share it already, which is the limit; end one of these' in told.stdout + told.stderr, told
        stopped = run('stop', board.host_url)
        assert stopped.returncode == 0, stopped
        sent = run('send', board.host_url, 'E:CLEAR')
        assert sent.returncode == 0, sent


def test_a_refusal_names_a_suspended_controlling_program(board):
    with driving(board.host_url, 'O:358,1,1') as host:
        host.signal(signal.SIGSTOP)
        os.waitid(os.P_PID, host.process.pid, os.WSTOPPED | os.WNOWAIT)
        try:
            refused = run('send', board.host_url, 'O:1,1,1')
            assert refused.returncode != 0
            assert f'controlled by r4 (pid {host.process.pid}), which is stopped; end that program' in refused.stderr, refused
        finally:
            host.signal(signal.SIGCONT)


@pytest.fixture(name='nobody')
def as_another_user(folder):
    """Runs r4 as the user nobody, with only the group nogroup."""
    if os.geteuid() != 0:
        pytest.skip('only root may run programs as another user')
    r4 = shutil.copy(R4, folder)

    def run_as_nobody(*arguments):
        return subprocess.run([r4, *arguments], user='nobody', group='nogroup', extra_groups=[], cwd=folder,
                              capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    return run_as_nobody


HAMMER = """
import socket, sys
while True:
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as other:
        other.connect(chr(0) + sys.argv[1])
"""


def test_connections_of_another_user_do_not_delay_the_host_or_a_stop(folder):
    if os.geteuid() != 0:
        pytest.skip('only root may run programs as another user')
    with Board(f'pty:{folder}/tty') as board, driving(board.host_url, 'O:358,1,1') as host, contextlib.ExitStack() as others:
        name = f'r4link/{os.geteuid()}/control/serial/{os.path.realpath(folder + "/tty")}'
        for _ in range(20):
            # With nice, the programs fill the queue but leave the processor to the board and its host.
            other = subprocess.Popen(['nice', '/usr/bin/python3', '-S', '-c', HAMMER, name], user='nobody',
                                     group='nogroup', extra_groups=[], cwd='/')
            others.callback(other.wait)
            others.callback(other.kill)
        board.never('SAFE', 2)
        assert host.process.poll() is None and all(each['type'] != 'error' for each in host.log)
        # The stop goes through the host's socket, and waits in its queue with the other clients.
        stopped = run('stop', board.host_url, '--json')
        assert stopped.returncode == 0, stopped
        board.state('SAFE', 'stop')


def test_another_user_shares_a_path_if_both_users_allow_it(board, nobody):
    shared = board.host_url + ('&' if '?' in board.host_url else '?') + 'share=nogroup'
    with driving(shared, 'O:358,1,1') as host:
        watched = nobody('monitor', shared, '--json', '--count', '3')
        assert watched.returncode == 0 and '"OSMC1":[358,1]' in watched.stdout, watched
        refused = nobody('send', shared, 'O:1,1,1')
        assert refused.returncode == 3 and f'controlled by r4 (pid {host.process.pid})' in refused.stderr, refused
        outside = nobody('monitor', board.host_url, '--json', '--count', '3')
        if board.host_url.startswith('serial:'):
            assert outside.returncode in (4, 5) and ERROR.search(outside.stderr), outside
        stopped = nobody('stop', shared)
        assert stopped.returncode == 0, stopped
        board.state('SAFE', 'stop')
