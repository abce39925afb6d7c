# SPDX-License-Identifier: GPL-3.0-or-later
"""Several real paths to one board: two UDP paths and a pty, which are pulled and plugged in while a host drives."""
import contextlib
import os
import pathlib
import re
import signal
import time

import pytest

from lan import Lan
from machine import within
from r4_process import (ERROR, PATIENCE_S, Board, Running, free_port, is_link, is_state, lasts, monitor, objects,
                        run, text_of)
from host_on_paths import (BACK_WITHIN_S, LONGEST_GAP_S, REPORTED_WITHIN_S, TIMEOUT_S, HostOnPaths, Relay, has_joined,
                           has_left, require_executed_as_told)


@contextlib.contextmanager
def wired(*kinds):
    """A board, and a path of each kind to it."""
    folder = pathlib.Path(os.environ.get('TMPDIR', '/tmp')) / f'r4-paths-{os.getpid()}'
    folder.mkdir(exist_ok=True)
    paths = []
    try:
        with Board('udp://127.0.0.1:0', f'pty:{folder}/board') as board:
            port = board.url.rsplit(':', 1)[1]
            ends = {'udp': (port,), 'pty': (f'{folder}/host', f'{folder}/board')}
            for kind in kinds:
                paths.append(Relay(kind, *ends[kind]))
            yield board, paths
    finally:
        for path in paths:
            if path.process.poll() is None:
                path.signal(signal.SIGCONT)
                path.pull()
        for left in folder.iterdir():
            left.unlink()
        folder.rmdir()


def is_path(path, carries=True):
    """Matches the monitor's event that the path begins to carry, or ceases to carry."""
    place = re.search(r'[\d.]+:\d+|/[^?]+', path.url)[0]
    return lambda each: (each['type'] == 'path' and place in each['fields']['name'] and
                         (each['fields']['state'] == 'carrying') == carries)


def of_two(paths):
    return '+'.join(path.url for path in paths)


def carried(paths):
    """A host process that controls a board over paths that all carry."""
    host = monitor('+'.join(path.url for path in paths))
    host.next(is_link('active'))
    for path in paths:
        if not any(is_path(path)(each) for each in host.log):
            host.next(is_path(path))
    host.next(is_state)
    return host


def judge(host, began, what):
    """Asserts that the host has lost no state since `began`."""
    for _ in range(20):
        host.next(is_state)
    states = [each for each in host.log if is_state(each)]
    came = [each['came'] for each in states if each['came'] >= began]
    gap = max(later - earlier for earlier, later in zip(came, came[1:]))
    print(f'{what}; longest gap between states {gap * 1e3:.0f} ms')
    times = [each['t'] for each in states]
    assert times == sorted(set(times)), 'a state was reported twice, or after a newer one'
    assert not [each for each in host.log if each['type'] == 'link' and each['came'] > began and
                each['fields']['state'] != 'active']
    assert gap <= within(LONGEST_GAP_S)


def test_no_state_is_lost_while_a_cable_is_unplugged():
    with wired('pty', 'udp') as (board, paths), carried(paths) as host:
        def told(event, **counts):
            path = board.next(lambda each: each.get('path', {}).get('event') == event)['path']
            assert {name: path[name] for name in counts} == counts, path

        told('joined', paths=2, joins=1, losses=0)
        began = time.monotonic()
        cable = paths[0]
        cable.pull()
        lost = host.next(is_path(cable, carries=False))['came'] - began
        plugged = time.monotonic()
        cable.plug_in()
        back = host.next(is_path(cable))['came'] - plugged
        told('left', paths=1, joins=1, losses=1)
        told('joined', paths=2, joins=2, losses=1)
        judge(host, began, f'told of it after {lost * 1e3:.0f} ms, used again after {back * 1e3:.0f} ms')
    assert lost <= within(REPORTED_WITHIN_S) and back <= within(BACK_WITHIN_S)


def test_old_datagrams_of_a_delayed_path_have_no_effect():
    with wired('udp', 'udp') as (board, paths), carried(paths) as host:
        began = time.monotonic()
        paths[0].signal(signal.SIGSTOP)  # the system does not report this loss
        lost = host.next(is_path(paths[0], carries=False))['came'] - began
        went_on = time.monotonic()
        paths[0].signal(signal.SIGCONT)
        back = host.next(is_path(paths[0]))['came'] - went_on
        judge(host, began, f'told of it after {lost * 1e3:.0f} ms, used again after {back * 1e3:.0f} ms')
        paths[0].pull()  # the other path carries all datagrams
        host.next(is_path(paths[0], carries=False))
        judge(host, began, 'the other one pulled')
        board.never('SAFE', 0.2)
    assert lost <= within(TIMEOUT_S + REPORTED_WITHIN_S) and back <= within(BACK_WITHIN_S)


class Sends:
    """r4 send with one command after the other, each with a different value. On a busy machine the link may be lost,
    which ends r4 send. Then a new r4 send continues with the next command, at most twice."""

    def __init__(self, urls, most):
        self.urls, self.most = urls, most
        self.asked, self.results = [], []
        self.begun = 0
        self.host = None
        self._begin()

    def _begin(self):
        first = len(self.results)
        last = first + self.most - self.confirmed()
        self.asked[first:] = [f'S:{1000 + i % 1000},{i % 16 + 1}' for i in range(first, last)]
        self.host = Running('send', *self.urls, *self.asked[first:], '--json', '--hold', '60')
        self.begun += 1

    def confirmed(self):
        return sum(each['confirmed'] for each in self.results)

    def until(self, confirmed):
        while self.confirmed() < confirmed:
            result = self.host.next()
            assert result['command'] == self.asked[len(self.results)]
            self.results.append(result)
            if result['confirmed']:
                continue
            assert self.begun < 3, result
            assert self.host.wait() == 3
            self._begin()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.host.__exit__()


def test_each_command_is_executed_once_while_paths_fail_and_recover():
    with wired('pty', 'udp') as (board, paths):
        with Sends([path.url for path in paths], 400) as sends:
            board.next(has_joined(2))
            sends.until(50)
            paths[0].pull()
            sends.until(120)
            paths[0].plug_in()
            board.next(has_joined(2))  # before this event the board has only one path, which must not fail
            sends.until(190)
            paths[1].signal(signal.SIGSTOP)
            sends.until(260)
            paths[1].signal(signal.SIGCONT)
            sends.until(330)
            paths[1].pull()
            sends.until(400)
        slowest = max(each['ms'] for each in sends.results)
        print(f'{len(sends.results)} commands: the slowest took {slowest:.0f} ms')
        require_executed_as_told(sends.results, board.rest())


@pytest.mark.parametrize('signals', [(signal.SIGSTOP, signal.SIGCONT), (signal.SIGKILL, None)])
def test_a_session_survives_a_suspended_or_killed_bridge_on_one_path(tmp_path, signals):
    tty = tmp_path / 'board'
    with Board('udp://127.0.0.1:0', f'pty:{tty}') as board, contextlib.ExitStack() as bridges:
        port = free_port()

        def bridge():
            return bridges.enter_context(Running('bridge', f'udp://127.0.0.2:{port}', f'serial://{tty}', '--json'))

        def again():
            if signals[1]:
                running.signal(signals[1])
            else:
                bridge()

        running = bridge()
        with HostOnPaths([board.host_url, f'udp://127.0.0.2:{port}?listen=0'], ['127.0.0.1', '127.0.0.2']) as host:
            board.next(has_joined(2))
            host.loses_by_silence('127.0.0.2', lambda: running.signal(signals[0]))
            board.next(has_left(1))
            host.has_again('127.0.0.2', again)
            board.next(has_joined(2))
            host.ends(board)


def test_a_board_has_a_path_for_each_interface_of_this_computer():
    with Lan() as lan:
        robot, desk = lan.computer('10.77.0.1'), lan.computer('10.77.0.2', '10.77.0.3')
        by_switch, by_cable = desk.addresses
        with Board('udp://10.77.0.1', **robot.inside) as board, HostOnPaths(
                [f'udp://10.77.0.1?local={address}' for address in desk.addresses], desk.addresses,
                **desk.inside) as host:
            board.next(has_joined(2))
            for place, gone, there in (
                    (by_cable, lambda: desk.plug(1, False), lambda: desk.plug(1, True)),
                    (by_switch, lambda: desk.switch(0, 'down'), lambda: desk.switch(0, 'up'))):
                host.loses(place, gone)
                host.goes_on()
                host.has_again(place, there)
                host.goes_on(50)  # until the board has also joined the paths
            host.ends(board)


def test_every_r4_command_accepts_several_paths(tmp_path):
    with wired('udp', 'pty') as (board, paths):
        urls = [path.url for path in paths]
        joined = of_two(paths)
        assert run('send', *urls, 'R:1,On', 'Q:ID').returncode == 0
        measured = run('bench', *reversed(urls), '--duration', '0.5', '--json')
        assert measured.returncode == 0, measured
        assert objects(measured.stdout)[0]['lost'] == 0
        told = objects(run('doctor', joined, '--duration', '0.3', '--json').stdout)
        assert {each['url'] for each in told if each['type'] == 'link'} == set(urls)

        drive = tmp_path / 'drive.r4log'
        assert run('record', joined, '-o', drive, '--duration', '1').returncode == 0
        text = text_of(drive)
        for number in (1, 2):
            assert re.search(rf' {number}< AIN24', text), f'no state by path {number}'
        seen = run('info', drive).stdout
        assert '127.0.0.2' in seen and '/host' in seen, seen

        stop = run('stop', *urls)
        assert stop.returncode == 0 and f'r4 send {joined} E:CLEAR' in stop.stdout, stop
        # One path that works is enough.
        paths[0].pull()
        assert run('stop', *urls).returncode == 0
        assert run('stop', 'serial:///dev/nothing', urls[1]).returncode == 0


def test_paths_to_two_boards_are_refused_with_both_names():
    boards = [Board('udp://127.0.0.1:0', options=('--board-id', name)) for name in ('left', 'right')]
    with boards[0] as left, boards[1] as right:
        for command in (('send', left.host_url, right.host_url, 'R:1,On'),
                        ('monitor', f'{left.host_url}+{right.host_url}', '--control', '--duration', '3'),
                        ('bench', left.host_url, right.host_url)):
            refused = run(*command)
            assert refused.returncode == 3, refused
            assert ERROR.search(refused.stderr) and 'left' in refused.stderr and 'right' in refused.stderr, refused
        for board in boards:
            board.skip_past()
        assert run('stop', left.host_url, right.host_url).returncode == 3
        for board in boards:  # each board is stopped nevertheless
            board.executed('E:STOP')


@pytest.mark.parametrize('arguments, told', [
    (('send', 'udp://127.0.0.1', 'udp://127.0.0.1', 'R:1,On'), 'the same path is given twice'),
    (('send', 'udp://127.0.0.1', 'udp:auto'), 'CMD: is missing'),
    (('send', 'udp://127.0.0.1', 'R:1,On', 'udp:auto'), 'a URL cannot follow R:1,On'),
    (('send', 'sim:', 'udp://127.0.0.1', 'R:1,On'), 'a separate board'),
    (('send', 'serial:auto', 'udp://127.0.0.1', 'C:key,1:' + 64 * 'a'), 'other programs could read it'),
    (('stop', *(f'udp://127.0.0.{i}' for i in range(1, 6))), 'one to 4 paths are possible'),
    (('monitor', 'serial:auto+upd://127.0.0.1'), "there is no transport 'upd'"),
    (('monitor', 'can://can0?node=0-3+udp://127.0.0.1:20-21'), 'the paths lead to 4 and to 2 boards'),
])
def test_invalid_urls_and_paths_are_refused_with_one_line(arguments, told):
    refused = run(*arguments)
    assert refused.returncode == 2 and ERROR.search(refused.stderr) and told in refused.stderr, refused
    assert len(refused.stderr.splitlines()) == 1, refused


def test_monitor_prints_a_line_when_a_path_goes_down():
    with wired('pty', 'udp') as (_, paths):
        with Running('monitor', of_two(paths), '--control') as host:
            came = []

            def line_with(words):
                while not any(words in line for line in came):
                    came.append(host.lines.get(timeout=PATIENCE_S)[1])

            line_with('/host: carrying')
            line_with('udp://127.0.0.2')
            lasts(0.2)
            paths[0].pull()
            line_with('/host: down')
