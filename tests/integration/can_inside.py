# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that test_can.py runs where SocketCAN exists: boards and hosts as processes on a CAN bus.

vcan0 is a bus in the kernel. can0 and can1 are two controllers with their driver on one bus.
"""
import contextlib
import re
import signal
import subprocess
import threading
import time
import urllib.request

import pytest

from r4_process import (DATA, ERROR, PATIENCE_S, Board, Running, driving, is_link, is_state, lasts, monitor,
                        objects, run, send, wait_for, watch)

BUS = 'can://vcan0?node=3'
IN_PLAIN_TEXT = BUS + '&pack=0'
EMERGENCY, WENT_SAFE, COMMAND, REPLY, TELEMETRY, WATCH = 0x010, 0x023, 0x183, 0x203, 0x403, 0x603


def ip(*arguments):
    subprocess.run(['ip', *arguments], check=True)


# The emulated machine needs about 100 us for a frame, and a state in plain text has 25 frames. So tests that do not
# test the rate use a lower rate. tests/simulation/can_capacity_test.cpp tests 100 Hz, in virtual time.
PERIOD_MS = 50
SLOWLY = ('--set', f'rate,{1000 // PERIOD_MS}')
# The emulated machine sometimes pauses for a second. Tests that do not test the board's timeout use a longer timeout.
PATIENTLY = (*SLOWLY, '--set', 'timeout,5000')


def on_vcan():
    """A board on a bus in the kernel. The hosts use plain text."""
    board = Board(BUS, options=PATIENTLY)
    board.bus, board.packs = 'vcan0', False
    board.host_url = IN_PLAIN_TEXT
    return board


def on_controllers(options=PATIENTLY):
    """A board at one of two controllers with their driver. The hosts use the other controller and the packed form."""
    board = Board('can://can0?node=3', options=options)
    board.bus, board.packs = 'can1', True
    board.host_url = 'can://can1?node=3'
    return board


@pytest.fixture(name='either_board', params=[on_vcan, on_controllers])
def on_each_bus(request):
    with request.param() as board:
        yield board


@pytest.fixture(name='board')
def beyond_a_controller():
    with on_controllers() as board:
        yield board


@pytest.fixture(name='impatient_board')
def with_its_usual_timeout():
    with on_controllers(SLOWLY) as board:
        yield board


@contextlib.contextmanager
def beside(*command, **options):
    """Runs a program until the block ends, or until the program ends."""
    with subprocess.Popen(command, **options) as process:
        try:
            yield process
        finally:
            process.terminate()


class Dump:
    """Every frame on an interface, as (id, data), received by candump, which shares no code with r4.

    `times`: when the kernel received each frame, as time.time().
    """

    def __init__(self, interface):
        self.process = subprocess.Popen(['candump', '-L', interface], stdout=subprocess.PIPE, text=True)
        self.frames = []
        self.times = []
        self.came = threading.Event()
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self):
        for line in self.process.stdout:
            at, _, text = line.split()
            frame, _, data = text.partition('#')
            self.times.append(float(at[1:-1]))
            self.frames.append((int(frame, 16), data.lstrip('#')))
            self.came.set()

    def more(self, count):
        """Waits for `count` more frames."""
        wanted = len(self.frames) + count
        deadline = time.monotonic() + PATIENCE_S
        while len(self.frames) < wanted:
            self.came.clear()
            assert self.came.wait(deadline - time.monotonic()), f'{wanted - len(self.frames)} frames are missing'

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.reader.join()
        self.process.stdout.close()
        self.process.wait()


def in_control(host):
    host.next(is_link('active'))
    return host.next(lambda each: is_state(each) and 'CMD' in each['fields'])


def test_the_times_of_states_are_whole_periods_apart(either_board):
    with monitor(either_board.host_url) as host:
        in_control(host)
        states = [host.next(is_state) for _ in range(20)]
        assert host.end() == 0
    times = [each['t'] for each in states]
    assert times == sorted(set(times)) and {time % PERIOD_MS for time in times} == {times[0] % PERIOD_MS}
    assert states[0]['transport'] == either_board.host_url


def test_states_confirm_commands_and_refusals_are_reported(either_board):
    result = send(either_board.host_url, 'O:358,1,1', 'S:1500,16', 'Q:ID')
    assert result.returncode == 0, result
    assert 'board sim-1' in result.stdout
    either_board.outputs(lambda outputs: outputs['osmc'][0] == [358, 1])
    either_board.outputs(lambda outputs: outputs['servo'][15] == 1498)
    result = send(either_board.host_url, 'E:STOP', 'O:1,1,1')
    assert result.returncode == 3 and 'SAFE' in result.stderr, result
    assert ERROR.search(result.stderr), result.stderr


def test_a_suspended_host_recovers_and_a_killed_host_leaves_it_safe(impatient_board):
    board = impatient_board
    with monitor(board.host_url) as host:
        in_control(host)
        host.signal(signal.SIGSTOP)
        board.state('SAFE', 'link')
        host.signal(signal.SIGCONT)
        board.state('ACTIVE')
        host.skip_past()
        host.next(is_state)
        host.signal(signal.SIGKILL)
        safe = board.state('SAFE', 'link')
    print(f'silence to safe {safe["silence"]} ms')
    assert safe['silence'] >= 1000


def test_a_second_host_is_refused_while_the_first_has_control(board):
    with monitor(board.host_url) as first:
        in_control(first)
        # can1 is the interface of the first host. can0 acts as another computer on the same bus.
        for command, where, why in (
                (('send', '--timeout', '2', 'O:358,1,1'), 'can1', f'controlled by r4 (pid {first.process.pid})'),
                (('send', '--timeout', '2', 'O:358,1,1'), 'can0', 'another host'),
                (('bench', '--duration', '0.5'), 'can0', 'another host')):
            result = run(command[0], f'can://{where}?node=3', *command[1:], timeout=60)
            assert result.returncode == 3 and why in result.stderr, result
        first.skip_past()
        first.next(is_state)
        assert not any(each['type'] == 'nack' for each in first.log), 'the second host did not send a command'
        assert not any(each.get('state') == 'SAFE' for each in board.log)
        assert run('stop', board.host_url, timeout=60).returncode == 0, 'a host without control may stop the board'
        first.next(is_link('safe', 'stop'))
        assert first.end() == 0
    assert not any(each.get('executed', {}).get('command') == 'O:358,1,1' for each in board.log)
    result = send(board.host_url, 'E:CLEAR')
    assert result.returncode == 0, f'control is free again: {result}'


def test_the_packed_form_needs_fewer_frames():
    def frames_a_state(url):
        with Dump('vcan0') as dump, monitor(url) as host:
            in_control(host)
            host.next(is_state)
            dump.frames.clear()
            for _ in range(10):
                host.next(is_state)
            count = len([data for frame, data in dump.frames if frame == TELEMETRY])
            assert host.end() == 0, host.errors  # releases control, so that the next host can take it
            return count / 10

    with Board(BUS, options=PATIENTLY) as board:
        plain = frames_a_state(IN_PLAIN_TEXT)
        packed = frames_a_state(BUS)
        measured = objects(run('bench', board.host_url, '--duration', '1', '--json', timeout=60).stdout)[0]
        assert measured['transfers']['packed'] > 5 and measured['transfers']['bad_form'] == 0
        print(f'{plain:.1f} frames a state plain, {packed:.1f} packed')
        assert 3 * packed < plain  # about 24 and 5 frames, including heartbeats
        assert send(BUS, 'C:pack,0').returncode == 0
        assert 3 * packed < frames_a_state(BUS), 'the board sends the packed form after C:pack,0'


def test_a_host_reports_an_interface_that_is_down_and_recovers(impatient_board):
    board = impatient_board
    with monitor(board.host_url) as host:
        in_control(host)
        ip('link', 'set', board.bus, 'down')
        down_at = time.monotonic()
        down = host.next(lambda each: each['type'] == 'link' and not each['fields']['up'])
        print(f'down after {(down["came"] - down_at) * 1000:.0f} ms')
        board.state('SAFE', 'link')
        refused = run('stop', board.host_url)
        assert refused.returncode == 4 and f'ip link set {board.bus} up' in refused.stderr, refused
        ip('link', 'set', board.bus, 'up')
        up_at = time.monotonic()
        up = host.next(lambda each: each['type'] == 'link' and each['fields']['up'])
        print(f'up after {(up["came"] - up_at) * 1000:.0f} ms')
        board.state('ACTIVE')
        host.skip_past()
        host.next(is_state)


def drives(pwm):
    return lambda each: is_state(each) and each['fields'].get('OSMC1') == [pwm, 1]


def test_monitor_and_send_work_in_either_order():
    def nobody_drives(watcher):
        watcher.skip_past()
        watcher.next(lambda each: is_state(each) and each['fields'].get('SAFE') == 1)

    with Board(BUS, options=SLOWLY) as board, watch(BUS) as early:
        nobody_drives(early)
        sent = send(BUS, 'R:1,On', 'O:100,1,1')
        assert sent.returncode == 0, sent
        early.next(drives(100))
        nobody_drives(early)
        with driving(BUS, 'O:358,1,1') as host, watch(BUS) as late:
            for each in (early, late):
                each.next(drives(358))
            assert run('stop', BUS, timeout=60).returncode == 0
            for each in (early, late):
                each.next(lambda state: is_state(state) and state['fields'].get('SAFE') == 2)
            board.state('SAFE', 'stop')
            host.end()
        assert send(BUS, 'E:CLEAR', 'O:1,1,1').returncode == 0


# At two controllers, the watcher and the host share no path, as on two computers.
@pytest.mark.parametrize('url, host_url', [(BUS, BUS), ('can://can0?node=3', 'can://can1?node=3')])
def test_a_watcher_sends_its_own_frame_only_while_no_host_drives(url, host_url):
    with Board(url, options=PATIENTLY), watch(url) as watcher, Dump(url.split('/')[2].split('?')[0]) as dump:
        watcher.next(is_state)
        assert {(frame, data) for frame, data in dump.frames if frame in (COMMAND, WATCH)} <= {(WATCH, '')}
        with driving(host_url, 'O:358,1,1') as host:
            watcher.next(drives(358))
            dump.frames.clear()
            dump.more(100)
            assert any(frame == COMMAND for frame, _ in dump.frames)
            assert not any(frame == WATCH for frame, _ in dump.frames)
            host.end()
        watcher.skip_past()
        watcher.next(lambda each: is_state(each) and each['fields'].get('SAFE') == 1)
        assert any(frame == WATCH for frame, _ in dump.frames)
        dump.frames.clear()
        assert run('stop', url, timeout=60).returncode == 0
        dump.more(1)  # so all frames of the stop have arrived
        sent = {frame for frame, _ in dump.frames}
        assert EMERGENCY in sent and COMMAND not in sent, 'r4 stop must not take control'


def test_record_includes_datagrams_of_a_host_on_another_computer(tmp_path):
    path = tmp_path / 'drive.r4log'
    said = [re.compile(rf'^[0-9.]+ 1> {what};SID:[0-9a-f]{{16}};PNum:\d+;(T:\d+;)?\^0x', re.MULTILINE) for what in ('H:ROS2-R4', 'Q:ID')]
    with Board('can://can0?node=3', options=PATIENTLY), monitor('can://can0?node=3'), \
            Running('record', 'can://can1?node=3', '-o', str(path)) as recorder:
        deadline = time.monotonic() + PATIENCE_S
        while not (path.exists() and all(each.search(path.read_text()) for each in said)):
            assert time.monotonic() < deadline, path.read_text()
            lasts(0.05)
        assert recorder.end() == 0, recorder.errors


@pytest.mark.parametrize('url, code, message', [
    ('can://can7?node=1', 6, 'there is no interface can7'),
    ('can://lo?node=1', 2, 'lo is not a CAN interface'),
    ('can://can0?fd=1', 4, 'not set up for CAN FD'),
])
def test_a_url_that_cannot_be_opened_is_reported_with_a_fix(url, code, message):
    result = run('monitor', url)
    assert result.returncode == code and message in result.stderr, result
    assert ERROR.fullmatch(result.stderr.strip()), result.stderr


def test_garbage_on_the_ids_of_the_board_has_no_effect(board):
    with monitor(board.host_url) as host:
        in_control(host)
        for identifier in (COMMAND, REPLY, TELEMETRY, WENT_SAFE):
            subprocess.run(['cangen', board.bus, '-I', f'{identifier:x}', '-n', '300', '-g', '0'], check=True)
        host.skip_past()
        host.next(is_state)
        counts = [each['fields'] for each in host.rest() if each['type'] == 'transfers'][0]
    assert counts['unexpected'] > 0 and counts['malformed'] > 0, counts
    assert board.packs or counts['packed'] == 0, counts
    board.state('SAFE', 'link')
    executed = [each['executed']['command'] for each in board.log if 'executed' in each]
    assert executed and all(command.startswith('F:') for command in executed), executed


def listed_interfaces(is_told):
    """Repeats r4 list until `is_told` is true for each board at vcan0. r4 list waits 1.3 s, and the guest may be slower."""
    deadline = time.monotonic() + PATIENCE_S
    while True:
        listed = {each.get('interface'): each for each in objects(run('list', '--json', timeout=60).stdout)}
        if all(map(is_told, listed['vcan0']['boards'])) or time.monotonic() > deadline:
            return listed


def test_list_says_that_a_device_with_ids_of_a_board_may_be_another_device():
    with beside('cangen', 'vcan0', '-I', '205', '-L', '2', '-D', '0600', '-g', '20'):  # RPDO1 of CANopen device 5
        listed = run('list', timeout=60)
    board = re.search(r'can://vcan0\?node=5 (.*)\n', listed.stdout)
    assert board and board[1].endswith(', perhaps of another device; look at r4 bus can://vcan0'), listed


def test_list_and_monitor_show_every_board_of_a_bus(tmp_path):
    with Board('can://vcan0?node=2-4', listens=3, options=PATIENTLY), monitor(IN_PLAIN_TEXT) as host:
        in_control(host)
        listed = listed_interfaces(is_told=lambda board: 'board_id' in board)
        boards = listed['vcan0']['boards']
        assert [(each['node'], each.get('board_id'), each.get('busy')) for each in boards] == [
            (2, 'sim-2', False), (3, 'sim-3', True), (4, 'sim-4', False)], boards
        assert boards[1]['held_by'] == {'program': 'r4', 'pid': host.process.pid, 'controls': True}, boards
        assert 'held_by' not in boards[0], boards
        assert listed['can0']['state'] == 'error-active' and listed['can0']['bitrate'] == 1000000
        assert listed['can0']['boards'] == []

        with Running('monitor', 'can://vcan0', '--json') as bus:
            heard = {2, 3, 4}
            while heard:
                heard.discard(bus.next(lambda each: each['type'] == 'heartbeat')['node'])
            assert {each['node'] for each in bus.rest() if each['type'] == 'state'} == {3}
        table = run('monitor', 'can://vcan0', '--count', '30', timeout=60).stdout
        assert 'ACTIVE' in table and 'CONNECTING' in table

        recording = tmp_path / 'bus.r4log'
        with Running('record', 'can://vcan0', '-o', str(recording)) as recorder:
            for number in (1, 2, 3):
                wait_for(recording, rf'^[0-9.]+ {number}<')
            assert recorder.end() == 0, recorder.errors
        [told] = objects(run('info', '--json', str(recording)).stdout)
        assert sorted(each['url'] for each in told['paths']) == [f'can://vcan0?node={node}' for node in (2, 3, 4)]

        *rows, total = objects(run('bus', 'can://vcan0', '--json', '--duration', '1', timeout=60).stdout)
        load = {row['id']: row['load'] for row in rows}
        assert load[TELEMETRY] > 3 * load[TELEMETRY - 1] > 0
        assert abs(sum(load.values()) - total['load']) < 1e-9 and total['nearly_full'] is False
        warned = run('bus', 'can://vcan0', '--duration', '0.5', '--bitrate', str(max(10_000, round(total['bits'] / 10))),
                     timeout=60)
        assert warned.returncode == 0 and re.search('more than a bus of [0-9.]+ kbit/s carries', warned.stderr), warned
        host.skip_past()
        host.next(is_state)
    silent = run('monitor', 'can://vcan0', '--duration', '0.3', timeout=60)
    assert silent.returncode == 3 and ERROR.search(silent.stderr), silent
    silent = run('record', 'can://vcan0', '-o', str(tmp_path / 'silence'), '--duration', '0.3', timeout=60)
    assert silent.returncode == 3 and 'no board was found on the bus' in silent.stderr, silent


def test_replay_acts_as_a_board_on_the_bus(tmp_path):
    with open(f'{DATA}/paper_capture.tsv', encoding='ascii') as capture:
        said = [line.rstrip('\n').split('\t')[1] for line in capture if line.startswith('board')]
    path = tmp_path / 'drive.r4log'
    lines = ['# r4log 1 by r4', '1795468293.000000 2> E:STOP;^0x506f0fbe^',
             *(f'{1795468293 + number / 5:.6f} 2< {datagram}' for number, datagram in enumerate(said))]
    path.write_text('\n'.join(lines + ['']), encoding='ascii')
    was = {each['pnum']: each['fields'] for each in objects(run('decode', stdin='\n'.join(said)).stdout)
           if each.get('type') == 'state'}
    with Running('replay', str(path), BUS, '--path', '2', '--json') as replay, Dump('vcan0') as dump:
        assert replay.next(lambda each: each['type'] == 'listening')['host_url'] == BUS
        shown = objects(run('monitor', BUS, '--json', '--count', '5', timeout=60).stdout)
        assert replay.end() == 0, replay.errors
    states = [(each['pnum'], each['fields']) for each in shown if each['type'] == 'state']
    assert len(states) == 5 and all(was[pnum] == fields for pnum, fields in states), states
    frames = {frame for frame, _ in dump.frames}
    assert TELEMETRY in frames and EMERGENCY not in frames, 'datagrams sent during the fault were sent again'


def test_metrics_report_the_busy_time_of_a_bus_for_each_board():
    boards = 'can://vcan0?node=2-3'
    with Board(boards, listens=2, options=PATIENTLY), driving('can://vcan0?node=3', 'O:358,1,1'):
        with Running('metrics', boards, '--json', '--listen', '127.0.0.1:0') as metrics:
            url = metrics.next(lambda each: each['type'] == 'listening')['url']

            def busy_seconds():
                with urllib.request.urlopen(url, timeout=PATIENCE_S) as answer:
                    found = re.findall(r'r4_can_busy_seconds_total\{interface="vcan0",node="(\d+)"\} (\S+)', answer.read().decode())
                return {int(node): float(seconds) for node, seconds in found}
            deadline = time.monotonic() + PATIENCE_S
            while busy_seconds().get(3, 0) < 0.01:
                assert time.monotonic() < deadline, busy_seconds()
            assert busy_seconds()[3] > busy_seconds().get(2, 0), 'the board without a controlling host sends few states'


def test_r4_bus_asks_for_the_data_bit_rate():
    with beside('cangen', 'vcan0', '-b', '-g', '20'):
        warned = run('bus', 'can://vcan0', '--duration', '0.5', timeout=60)
        assert warned.returncode == 0 and '--dbitrate' in warned.stderr, warned
        told = run('bus', 'can://vcan0', '--duration', '0.5', '--dbitrate', '5000000', timeout=60)
        assert told.returncode == 0 and told.stderr == '', told


def test_r4_bus_uses_the_bit_rate_of_the_controller():
    def set_to(rate):
        ip('link', 'set', 'can0', 'down')
        ip('link', 'set', 'can0', 'up', 'type', 'can', 'bitrate', str(rate))

    set_to(250000)
    try:
        with beside('cangen', 'can1', '-g', '2', '-L', '8'):
            *rows, total = objects(run('bus', 'can://can0', '--json', '--duration', '0.5', timeout=60).stdout)
        listed = {each.get('interface'): each for each in objects(run('list', '--json', timeout=60).stdout)}
        refused = run('bus', 'can://can0', '--bitrate', '1000000')
    finally:
        set_to(1000000)
    assert total['bitrate'] == 250000 == listed['can0']['bitrate'], total
    assert rows and abs(total['load'] * 250000 / total['bits'] - 1) < 1e-3, total
    assert refused.returncode == 2 and '250000' in refused.stderr, refused


def test_the_demo_succeeds_over_can():
    result = run('demo', '--json', timeout=60)
    assert result.returncode == 0, result
    row = next(each for each in objects(result.stdout) if each.get('transport') == 'CAN')
    assert row['ok'], row
