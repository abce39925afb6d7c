# SPDX-License-Identifier: GPL-3.0-or-later
"""Programs that share a wire: what one user runs in several terminals, on the same URL."""
import os
import re
import shutil
import signal
import socket
import subprocess
import tempfile

import pytest

from r4_process import ERROR, PATIENCE_S, R4, Board, driving, is_state, run, stop_takes_ms, watch


@pytest.fixture(name='folder')
def where_anybody_may_look():
    with tempfile.TemporaryDirectory() as folder:
        os.chmod(folder, 0o755)
        yield folder


@pytest.fixture(name='board', params=['pty', 'udp'])
def on_a_wire(request, folder):
    url = f'pty:{folder}/tty' if request.param == 'pty' else 'udp://127.0.0.1:0'
    with Board(url) as board:
        if request.param == 'udp':
            # One port for all, as the port of hosts is.
            board.host_url = re.sub(r'\?listen=0$', f'?listen={free_port()}', board.host_url)
        yield board


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(('0.0.0.0', 0))
        return probe.getsockname()[1]


def drives(pwm):
    return lambda each: is_state(each) and each['fields'].get('OSMC1') == [pwm, 1]


def is_safe(each):
    return is_state(each) and each['fields'].get('SAFE') == 1


def test_monitors_and_sends_in_any_order(board):
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


def test_a_third_is_refused_with_the_name_and_pid_of_who_controls(board):
    with watch(board.host_url), driving(board.host_url, 'O:358,1,1') as host:
        for command in (['send', board.host_url, 'O:1,1,1'], ['monitor', board.host_url, '--control']):
            refused = run(*command)
            assert refused.returncode == 3, refused
            assert f'controlled by r4 (pid {host.process.pid})' in refused.stderr + refused.stdout
        board.never('SAFE', 1)


def test_a_stop_from_the_second_terminal(board):
    with watch(board.host_url) as watcher, driving(board.host_url, 'O:358,1,1'):
        watcher.next(drives(358))
        stop_takes_ms(board.host_url)
        board.state('SAFE', 'stop')
        watcher.next(lambda each: is_state(each) and each['fields'].get('SAFE') == 2)


def test_of_five_that_watch_one_sleeps_one_dies_and_nobody_else_notices(board):
    watchers = [watch(board.host_url) for _ in range(5)]
    try:
        for each in watchers:
            each.next(is_state)
        with driving(board.host_url, 'O:358,1,1') as host:
            for each in watchers:
                each.next(drives(358))
            watchers[0].signal(signal.SIGSTOP)
            watchers[1].signal(signal.SIGKILL)
            board.never('SAFE', 3)
            for each in watchers[2:]:
                each.skip_past()
                states = [each.next(is_state) for _ in range(50)]
                assert states[-1]['pnum'] - states[0]['pnum'] < 100
            watchers[0].signal(signal.SIGCONT)
            watchers[0].skip_past()
            watchers[0].next(drives(358))
            killed = host.signal(signal.SIGKILL)
            assert board.state('SAFE', 'link')['came'] - killed < 1.1
            for each in watchers[2:]:
                # The next state, of a board that nobody controls: another has taken the wire over.
                each.next(is_safe)
    finally:
        for each in watchers:
            each.__exit__()


def test_a_driving_program_that_is_stopped_is_named(board):
    with driving(board.host_url, 'O:358,1,1') as host:
        host.signal(signal.SIGSTOP)
        try:
            refused = run('send', board.host_url, 'O:1,1,1')
            assert refused.returncode != 0
            assert f'(pid {host.process.pid}) does not answer' in refused.stderr, refused
        finally:
            host.signal(signal.SIGCONT)


@pytest.fixture(name='nobody')
def as_another_user(folder):
    """Runs r4 as the user nobody, of the group nogroup alone."""
    if os.geteuid() != 0:
        pytest.skip('only root may run programs as another user')
    r4 = shutil.copy(R4, folder)

    def run_as_nobody(*arguments):
        return subprocess.run([r4, *arguments], user='nobody', group='nogroup', extra_groups=[], cwd=folder,
                              capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    return run_as_nobody


def test_another_user_shares_a_wire_where_both_say_so(board, nobody):
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
